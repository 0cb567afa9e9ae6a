#version 330 core
uniform usampler2DMS triangles;
uniform int sample_number;

out uint triangle;

void main()
{
    triangle = texelFetch(triangles, ivec2(gl_FragCoord.xy), sample_number).r;
}
