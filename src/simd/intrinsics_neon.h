/* NEON, on AArch64 and on ARMv7; what ARMv7 lacks stands in two #if of __aarch64__. */
#include <arm_neon.h>

rl_f32x4 rl_f32x4_add(rl_f32x4 a, rl_f32x4 b) { return vaddq_f32(a, b); }
rl_f32x4 rl_f32x4_sub(rl_f32x4 a, rl_f32x4 b) { return vsubq_f32(a, b); }
rl_f32x4 rl_f32x4_mul(rl_f32x4 a, rl_f32x4 b) { return vmulq_f32(a, b); }
rl_f32x4 rl_f32x4_neg(rl_f32x4 a) { return vnegq_f32(a); }
rl_f32x4 rl_f32x4_abs(rl_f32x4 a) { return vabsq_f32(a); }

rl_f32x4 rl_f32x4_copy_sign(rl_f32x4 a, rl_f32x4 b) {
    return vbslq_f32(vdupq_n_u32(0x80000000u), b, a);
}

/* ARMv7's NEON divides and takes roots by estimates only. The exact ones are VFP's, one lane at a
 * time, which is what the compiler makes of these two. */
#ifdef __aarch64__
rl_f32x4 rl_f32x4_div(rl_f32x4 a, rl_f32x4 b) { return vdivq_f32(a, b); }
rl_f32x4 rl_f32x4_sqrt(rl_f32x4 a) { return vsqrtq_f32(a); }
#else
rl_f32x4 rl_f32x4_div(rl_f32x4 a, rl_f32x4 b) { return a / b; }
rl_f32x4 rl_f32x4_sqrt(rl_f32x4 a) { return __builtin_elementwise_sqrt(a); }
#endif

rl_f32x4 rl_f32x4_mul_add(rl_f32x4 a, rl_f32x4 b, rl_f32x4 c) {
#ifdef __ARM_FEATURE_FMA
    return vfmaq_f32(c, a, b);
#else
    return vmlaq_f32(c, a, b);
#endif
}

/* fmin and vmin return NaN where either operand is, and -0 before +0: not what the exact
 * operations ask for. */
rl_f32x4 rl_f32x4_min(rl_f32x4 a, rl_f32x4 b) { return vbslq_f32(vcltq_f32(a, b), a, b); }
rl_f32x4 rl_f32x4_max(rl_f32x4 a, rl_f32x4 b) { return vbslq_f32(vcgtq_f32(a, b), a, b); }
rl_f32x4 rl_f32x4_min_fast(rl_f32x4 a, rl_f32x4 b) { return vminq_f32(a, b); }
rl_f32x4 rl_f32x4_max_fast(rl_f32x4 a, rl_f32x4 b) { return vmaxq_f32(a, b); }

rl_u32x4 rl_f32x4_eq(rl_f32x4 a, rl_f32x4 b) { return vceqq_f32(a, b); }
rl_u32x4 rl_f32x4_lt(rl_f32x4 a, rl_f32x4 b) { return vcltq_f32(a, b); }
rl_u32x4 rl_f32x4_le(rl_f32x4 a, rl_f32x4 b) { return vcleq_f32(a, b); }

rl_f32x4 rl_f32x4_select(rl_u32x4 mask, rl_f32x4 a, rl_f32x4 b) { return vbslq_f32(mask, a, b); }

rl_f32x4 rl_f32x4_interleave_low(rl_f32x4 a, rl_f32x4 b) { return vzipq_f32(a, b).val[0]; }
rl_f32x4 rl_f32x4_interleave_high(rl_f32x4 a, rl_f32x4 b) { return vzipq_f32(a, b).val[1]; }

float rl_f32x4_reduce_min(rl_f32x4 a) {
    const float32x2_t low = vget_low_f32(a);
    const float32x2_t high = vget_high_f32(a);
    const float32x2_t pair = vbsl_f32(vclt_f32(low, high), low, high);
    const float32x2_t swapped = vrev64_f32(pair);
    return vget_lane_f32(vbsl_f32(vclt_f32(pair, swapped), pair, swapped), 0);
}

float rl_f32x4_reduce_max(rl_f32x4 a) {
    const float32x2_t low = vget_low_f32(a);
    const float32x2_t high = vget_high_f32(a);
    const float32x2_t pair = vbsl_f32(vcgt_f32(low, high), low, high);
    const float32x2_t swapped = vrev64_f32(pair);
    return vget_lane_f32(vbsl_f32(vcgt_f32(pair, swapped), pair, swapped), 0);
}

rl_i32x4 rl_f32x4_to_i32(rl_f32x4 a) { return vcvtq_s32_f32(a); }

rl_i32x4 rl_i32x4_add(rl_i32x4 a, rl_i32x4 b) { return vaddq_s32(a, b); }
rl_i32x4 rl_i32x4_sub(rl_i32x4 a, rl_i32x4 b) { return vsubq_s32(a, b); }
rl_i32x4 rl_i32x4_min(rl_i32x4 a, rl_i32x4 b) { return vminq_s32(a, b); }
rl_i32x4 rl_i32x4_max(rl_i32x4 a, rl_i32x4 b) { return vmaxq_s32(a, b); }
rl_i32x4 rl_i32x4_and(rl_i32x4 a, rl_i32x4 b) { return vandq_s32(a, b); }
rl_i32x4 rl_i32x4_or(rl_i32x4 a, rl_i32x4 b) { return vorrq_s32(a, b); }
rl_i32x4 rl_i32x4_xor(rl_i32x4 a, rl_i32x4 b) { return veorq_s32(a, b); }
rl_i32x4 rl_i32x4_mul(rl_i32x4 a, rl_i32x4 b) { return vmulq_s32(a, b); }

rl_i32x4 rl_i32x4_shift_left(rl_i32x4 a, uint32_t amount) {
    return vshlq_s32(a, vdupq_n_s32((int32_t)amount));
}

rl_i32x4 rl_i32x4_shift_right(rl_i32x4 a, uint32_t amount) {
    const uint32x4_t bits = vreinterpretq_u32_s32(a);
    return vreinterpretq_s32_u32(vshlq_u32(bits, vdupq_n_s32(-(int32_t)amount)));
}

rl_u32x4 rl_i32x4_eq(rl_i32x4 a, rl_i32x4 b) { return vceqq_s32(a, b); }
rl_u32x4 rl_i32x4_lt(rl_i32x4 a, rl_i32x4 b) { return vcltq_s32(a, b); }
rl_u32x4 rl_i32x4_le(rl_i32x4 a, rl_i32x4 b) { return vcleq_s32(a, b); }
rl_i32x4 rl_i32x4_select(rl_u32x4 mask, rl_i32x4 a, rl_i32x4 b) { return vbslq_s32(mask, a, b); }
rl_f32x4 rl_i32x4_to_f32(rl_i32x4 a) { return vcvtq_f32_s32(a); }

rl_u32x4 rl_mask4_and(rl_u32x4 a, rl_u32x4 b) { return vandq_u32(a, b); }
rl_u32x4 rl_mask4_or(rl_u32x4 a, rl_u32x4 b) { return vorrq_u32(a, b); }
rl_u32x4 rl_mask4_not(rl_u32x4 a) { return vmvnq_u32(a); }
rl_u32x4 rl_mask4_and_not(rl_u32x4 a, rl_u32x4 b) { return vbicq_u32(a, b); }

rl_u32x4 rl_mask4_from_bits(uint32_t bits) {
    const rl_u32x4 weights = {1, 2, 4, 8};
    return vtstq_u32(vdupq_n_u32(bits), weights);
}

#ifdef __aarch64__

uint32_t rl_mask4_any(rl_u32x4 a) { return vmaxvq_u32(a) != 0; }
uint32_t rl_mask4_all(rl_u32x4 a) { return vminvq_u32(a) != 0; }

uint32_t rl_mask4_bits(rl_u32x4 a) {
    const rl_u32x4 weights = {1, 2, 4, 8};
    return vaddvq_u32(vandq_u32(a, weights));
}

/* A set lane is -1. */
uint32_t rl_mask4_pop_count(rl_u32x4 a) { return 0u - vaddvq_u32(a); }

#else

/* ARMv7 has no operation across a register but the pairwise ones of doublewords. */
uint32_t rl_mask4_any(rl_u32x4 a) {
    const uint32x2_t pair = vorr_u32(vget_low_u32(a), vget_high_u32(a));
    return vget_lane_u64(vreinterpret_u64_u32(pair), 0) != 0;
}

uint32_t rl_mask4_all(rl_u32x4 a) {
    const uint32x2_t pair = vand_u32(vget_low_u32(a), vget_high_u32(a));
    return vget_lane_u64(vreinterpret_u64_u32(pair), 0) == UINT64_MAX;
}

uint32_t rl_mask4_bits(rl_u32x4 a) {
    const rl_u32x4 weights = {1, 2, 4, 8};
    const uint32x4_t set = vandq_u32(a, weights);
    const uint32x2_t pair = vorr_u32(vget_low_u32(set), vget_high_u32(set));
    return vget_lane_u32(vpadd_u32(pair, pair), 0);
}

uint32_t rl_mask4_pop_count(rl_u32x4 a) {
    const uint32x2_t pair = vadd_u32(vget_low_u32(a), vget_high_u32(a));
    return 0u - vget_lane_u32(vpadd_u32(pair, pair), 0);
}

#endif
