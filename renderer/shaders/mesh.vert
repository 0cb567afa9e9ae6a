#version 330 core
// Room and body are given in world coordinates, so there is no model matrix to apply.
layout(location = 0) in vec3 position;
layout(location = NORMAL_LOC) in vec3 normal;
#ifdef TEXCOORD_0_LOC
layout(location = TEXCOORD_0_LOC) in vec2 texture_coordinate;
out vec2 uv;
#endif
#ifdef TANGENT_LOC
// Baked openness for up to four sets of hidden furniture; one of them belongs to this view.
layout(location = TANGENT_LOC) in vec4 baked;
uniform vec4 occlusion_pick;
out float openness;
#endif
#ifdef COLOR_0_LOC
layout(location = COLOR_0_LOC) in vec4 vertex_colour;
out vec3 tint;
#endif

uniform mat4 V;
uniform mat4 P;

out vec3 world;
out vec3 surface_normal;

void main()
{
    gl_Position = P * (V * vec4(position, 1.0));
    world = position;
    surface_normal = normal;
#ifdef TEXCOORD_0_LOC
    uv = texture_coordinate;
#endif
#ifdef TANGENT_LOC
    openness = dot(baked, occlusion_pick);
#endif
#ifdef COLOR_0_LOC
    tint = vertex_colour.rgb;
#endif
}
