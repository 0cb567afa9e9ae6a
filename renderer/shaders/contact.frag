#version 330 core
// Coverage and height of the body's underside; filtered, their quotient is a mean of true heights.
in float height;

out vec2 covered_height;

void main()
{
    covered_height = vec2(1.0, height);
}
