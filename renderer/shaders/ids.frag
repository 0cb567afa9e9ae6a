#version 330 core
// Number of the triangle, counted from 1 over the whole room.
uniform int first_triangle;

out uint triangle;

void main()
{
    triangle = uint(first_triangle + gl_PrimitiveID + 1);
}
