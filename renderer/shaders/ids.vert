#version 330 core
// Same arithmetic as mesh.vert, so that depths agree bit by bit.
layout(location = 0) in vec3 position;

uniform mat4 V;
uniform mat4 P;

void main()
{
    gl_Position = P * (V * vec4(position, 1.0));
}
