#version 330 core
// Diffuse room and body under one shadowed key light, sky and ground ambient and a soft fill.
// All arithmetic is linear RGB; textures are decoded and the result is encoded here.

struct Key {
    vec3 color;
    float intensity;
    vec3 direction;
    sampler2DShadow shadow_map;
    mat4 light_matrix;
};

struct Material {
    vec4 base_color_factor;
#ifdef HAS_BASE_COLOR_TEX
    sampler2D base_color_texture;
#endif
};

uniform Key directional_lights[1];
uniform Material material;
uniform vec3 cam_pos;
uniform vec3 sky_light;
uniform vec3 ground_light;
uniform vec3 fill_light;
uniform vec3 fill_direction;
uniform float shadow_texel;      // metres
uniform float shadow_range;      // metres of the whole depth range
uniform sampler2D contact_map;   // coverage and height of the body's underside
uniform mat4 contact_matrix;

in vec3 world;
in vec3 surface_normal;
#ifdef TEXCOORD_0_LOC
in vec2 uv;
#endif
#ifdef TANGENT_LOC
in float openness;
#endif
#ifdef COLOR_0_LOC
in vec3 tint;
#endif

out vec4 frag_color;

const float PI = 3.141592653589793;
const float CONTACT_HEIGHT = 0.30;   // metres; keep equal to dirty.CONTACT_HEIGHT_M
const float CONTACT_DEPTH = 0.10;    // metres; keep equal to dirty.CONTACT_DEPTH_M
const float CONTACT_STEP = 0.028;    // metres; keep equal to dirty.CONTACT_STEP_M
const float CONTACT_STRENGTH = 0.70;

vec3 decoded(vec3 srgb)
{
    return mix(srgb / 12.92, pow((srgb + 0.055) / 1.055, vec3(2.4)), step(0.04045, srgb));
}

vec3 encoded(vec3 linear)
{
    vec3 c = clamp(linear, 0.0, 1.0);
    return mix(c * 12.92, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}

// Share of the key light that arrives: 3 x 3 bilinear comparisons, about 1 cm of penumbra.
// The point is moved along its normal by the reach of those comparisons, so that a surface does
// not shadow itself however slanted it is; the rest of the bias is a constant 2 mm.
float lit(vec3 n, float nl)
{
    float slant = sqrt(max(1.0 - nl * nl, 0.0));
    vec3 lifted = world + n * (shadow_texel * (0.6 + 2.6 * slant));
    vec3 at = (directional_lights[0].light_matrix * vec4(lifted, 1.0)).xyz * 0.5 + 0.5;
    if (any(lessThan(at, vec3(0.0))) || any(greaterThan(at, vec3(1.0)))) {
        return 1.0;
    }
    at.z -= 0.002 / shadow_range;
    vec2 texel = 1.0 / vec2(textureSize(directional_lights[0].shadow_map, 0));
    float sum = 0.0;
    for (int x = -1; x <= 1; x++) {
        for (int y = -1; y <= 1; y++) {
            sum += textureLod(directional_lights[0].shadow_map,
                              vec3(at.xy + vec2(x, y) * texel, at.z), 0.0);
        }
    }
    return sum / 9.0;
}

// Share of the sky that the body hides from a room surface just below it: strong where the body
// touches, gone at 30 cm. It tells standing from floating where the cast shadow lies elsewhere.
float covered(vec3 n)
{
    if (n.z < 0.1) {
        return 0.0;
    }
    vec2 at = (contact_matrix * vec4(world, 1.0)).xy * 0.5 + 0.5;
    vec2 step_uv = vec2(contact_matrix[0][0], contact_matrix[1][1]) * (0.5 * CONTACT_STEP);
    float sum = 0.0;
    for (int x = 0; x < 4; x++) {
        for (int y = 0; y < 4; y++) {
            vec2 seen = textureLod(contact_map, at + (vec2(x, y) - 1.5) * step_uv, 0.0).rg;
            if (seen.r > 0.0) {
                float gap = seen.g / seen.r - world.z;
                // Skin that is pressed a little into the surface still counts as touching it.
                float near = clamp(1.0 - max(gap, 0.0) / CONTACT_HEIGHT, 0.0, 1.0);
                sum += gap > -CONTACT_DEPTH ? seen.r * near * near : 0.0;
            }
        }
    }
    return CONTACT_STRENGTH * n.z * sum / 16.0;
}

void main()
{
    vec3 albedo = material.base_color_factor.rgb;
#ifdef HAS_BASE_COLOR_TEX
    albedo *= decoded(texture(material.base_color_texture, uv).rgb);
#endif
#ifdef COLOR_0_LOC
    albedo *= tint;
#endif
    // Nothing real is blacker than this; black lacquer would lose its shape altogether.
    albedo = mix(vec3(0.028), vec3(1.0), albedo);
    vec3 n = normalize(surface_normal);
    vec3 to_key = -directional_lights[0].direction;
    float nl = dot(n, to_key);

    vec3 ambient = mix(ground_light, sky_light, 0.5 + 0.5 * n.z);
    vec3 fill = fill_light * max(dot(n, -fill_direction), 0.0);
#ifdef TANGENT_LOC
    float open_share = openness * (1.0 - covered(n));
    ambient *= open_share;
    fill *= open_share;
#else
    // The body: limbs in front of limbs are told apart by a soft darkening towards their edges.
    float facing = abs(dot(n, normalize(cam_pos - world)));
    albedo *= mix(0.66, 1.0, smoothstep(0.0, 0.55, facing));
#endif
    float key = 0.0;
    if (nl > 0.0) {
        key = nl * lit(n, nl) / PI * directional_lights[0].intensity;
    }
    frag_color = vec4(encoded(albedo * (ambient + fill + key * directional_lights[0].color)), 1.0);
}
