/* SSE: the baseline of x86-64 is SSE2; SSE4.1 and FMA where the target has them. */
#include <immintrin.h>

#define F32(x) ((rl_f32x4)(x))
#define I32(x) ((rl_i32x4)(x))
#define U32(x) ((rl_u32x4)(x))
#define INT(x) ((__m128i)(x))

rl_f32x4 rl_f32x4_add(rl_f32x4 a, rl_f32x4 b) { return _mm_add_ps(a, b); }
rl_f32x4 rl_f32x4_sub(rl_f32x4 a, rl_f32x4 b) { return _mm_sub_ps(a, b); }
rl_f32x4 rl_f32x4_mul(rl_f32x4 a, rl_f32x4 b) { return _mm_mul_ps(a, b); }
rl_f32x4 rl_f32x4_div(rl_f32x4 a, rl_f32x4 b) { return _mm_div_ps(a, b); }
rl_f32x4 rl_f32x4_sqrt(rl_f32x4 a) { return _mm_sqrt_ps(a); }
rl_f32x4 rl_f32x4_neg(rl_f32x4 a) { return _mm_xor_ps(_mm_set1_ps(-0.0f), a); }
rl_f32x4 rl_f32x4_abs(rl_f32x4 a) { return _mm_andnot_ps(_mm_set1_ps(-0.0f), a); }

rl_f32x4 rl_f32x4_copy_sign(rl_f32x4 a, rl_f32x4 b) {
    const __m128 sign = _mm_set1_ps(-0.0f);
    return _mm_or_ps(_mm_andnot_ps(sign, a), _mm_and_ps(sign, b));
}

rl_f32x4 rl_f32x4_mul_add(rl_f32x4 a, rl_f32x4 b, rl_f32x4 c) {
#ifdef __FMA__
    return _mm_fmadd_ps(a, b, c);
#else
    return _mm_add_ps(_mm_mul_ps(a, b), c);
#endif
}

/* minps and maxps return their second operand where either is NaN or both are zeros, which is
 * what the exact operations ask for. */
rl_f32x4 rl_f32x4_min(rl_f32x4 a, rl_f32x4 b) { return _mm_min_ps(a, b); }
rl_f32x4 rl_f32x4_max(rl_f32x4 a, rl_f32x4 b) { return _mm_max_ps(a, b); }
rl_f32x4 rl_f32x4_min_fast(rl_f32x4 a, rl_f32x4 b) { return _mm_min_ps(a, b); }
rl_f32x4 rl_f32x4_max_fast(rl_f32x4 a, rl_f32x4 b) { return _mm_max_ps(a, b); }

rl_u32x4 rl_f32x4_eq(rl_f32x4 a, rl_f32x4 b) { return U32(_mm_cmpeq_ps(a, b)); }
rl_u32x4 rl_f32x4_lt(rl_f32x4 a, rl_f32x4 b) { return U32(_mm_cmplt_ps(a, b)); }
rl_u32x4 rl_f32x4_le(rl_f32x4 a, rl_f32x4 b) { return U32(_mm_cmple_ps(a, b)); }

rl_f32x4 rl_f32x4_select(rl_u32x4 mask, rl_f32x4 a, rl_f32x4 b) {
    const __m128 m = F32(mask);
#ifdef __SSE4_1__
    return _mm_blendv_ps(b, a, m);
#else
    return _mm_or_ps(_mm_and_ps(m, a), _mm_andnot_ps(m, b));
#endif
}

rl_f32x4 rl_f32x4_interleave_low(rl_f32x4 a, rl_f32x4 b) { return _mm_unpacklo_ps(a, b); }
rl_f32x4 rl_f32x4_interleave_high(rl_f32x4 a, rl_f32x4 b) { return _mm_unpackhi_ps(a, b); }

float rl_f32x4_reduce_min(rl_f32x4 a) {
    const __m128 pair = _mm_min_ps(a, _mm_movehl_ps(a, a));
    return _mm_cvtss_f32(_mm_min_ps(pair, _mm_shuffle_ps(pair, pair, 1)));
}

float rl_f32x4_reduce_max(rl_f32x4 a) {
    const __m128 pair = _mm_max_ps(a, _mm_movehl_ps(a, a));
    return _mm_cvtss_f32(_mm_max_ps(pair, _mm_shuffle_ps(pair, pair, 1)));
}

rl_i32x4 rl_f32x4_to_i32(rl_f32x4 a) { return I32(_mm_cvttps_epi32(a)); }

rl_i32x4 rl_i32x4_add(rl_i32x4 a, rl_i32x4 b) { return I32(_mm_add_epi32(INT(a), INT(b))); }
rl_i32x4 rl_i32x4_sub(rl_i32x4 a, rl_i32x4 b) { return I32(_mm_sub_epi32(INT(a), INT(b))); }
rl_i32x4 rl_i32x4_and(rl_i32x4 a, rl_i32x4 b) { return I32(_mm_and_si128(INT(a), INT(b))); }
rl_i32x4 rl_i32x4_or(rl_i32x4 a, rl_i32x4 b) { return I32(_mm_or_si128(INT(a), INT(b))); }
rl_i32x4 rl_i32x4_xor(rl_i32x4 a, rl_i32x4 b) { return I32(_mm_xor_si128(INT(a), INT(b))); }

rl_u32x4 rl_i32x4_eq(rl_i32x4 a, rl_i32x4 b) { return U32(_mm_cmpeq_epi32(INT(a), INT(b))); }
rl_u32x4 rl_i32x4_lt(rl_i32x4 a, rl_i32x4 b) { return U32(_mm_cmplt_epi32(INT(a), INT(b))); }
rl_u32x4 rl_i32x4_le(rl_i32x4 a, rl_i32x4 b) { return ~U32(_mm_cmpgt_epi32(INT(a), INT(b))); }

rl_i32x4 rl_i32x4_select(rl_u32x4 mask, rl_i32x4 a, rl_i32x4 b) {
    return I32(rl_f32x4_select(mask, F32(a), F32(b)));
}

rl_i32x4 rl_i32x4_min(rl_i32x4 a, rl_i32x4 b) {
#ifdef __SSE4_1__
    return I32(_mm_min_epi32(INT(a), INT(b)));
#else
    return rl_i32x4_select(rl_i32x4_lt(a, b), a, b);
#endif
}

rl_i32x4 rl_i32x4_max(rl_i32x4 a, rl_i32x4 b) {
#ifdef __SSE4_1__
    return I32(_mm_max_epi32(INT(a), INT(b)));
#else
    return rl_i32x4_select(rl_i32x4_lt(b, a), a, b);
#endif
}

rl_i32x4 rl_i32x4_mul(rl_i32x4 a, rl_i32x4 b) {
#ifdef __SSE4_1__
    return I32(_mm_mullo_epi32(INT(a), INT(b)));
#else
    const __m128i even = _mm_mul_epu32(INT(a), INT(b));
    const __m128i odd = _mm_mul_epu32(_mm_srli_epi64(INT(a), 32), _mm_srli_epi64(INT(b), 32));
    const int pairs = _MM_SHUFFLE(0, 0, 2, 0);
    return I32(_mm_unpacklo_epi32(_mm_shuffle_epi32(even, pairs), _mm_shuffle_epi32(odd, pairs)));
#endif
}

rl_i32x4 rl_i32x4_shift_left(rl_i32x4 a, uint32_t amount) {
    return I32(_mm_slli_epi32(INT(a), (int)amount));
}

rl_i32x4 rl_i32x4_shift_right(rl_i32x4 a, uint32_t amount) {
    return I32(_mm_srli_epi32(INT(a), (int)amount));
}

rl_f32x4 rl_i32x4_to_f32(rl_i32x4 a) { return _mm_cvtepi32_ps(INT(a)); }

rl_u32x4 rl_mask4_and(rl_u32x4 a, rl_u32x4 b) { return U32(_mm_and_ps(F32(a), F32(b))); }
rl_u32x4 rl_mask4_or(rl_u32x4 a, rl_u32x4 b) { return U32(_mm_or_ps(F32(a), F32(b))); }
rl_u32x4 rl_mask4_not(rl_u32x4 a) { return ~a; }
rl_u32x4 rl_mask4_and_not(rl_u32x4 a, rl_u32x4 b) { return U32(_mm_andnot_ps(F32(b), F32(a))); }

rl_u32x4 rl_mask4_from_bits(uint32_t bits) {
    const __m128i weights = _mm_setr_epi32(1, 2, 4, 8);
    const __m128i set = _mm_and_si128(_mm_set1_epi32((int)bits), weights);
    return U32(_mm_cmpeq_epi32(set, weights));
}

uint32_t rl_mask4_any(rl_u32x4 a) { return _mm_movemask_ps(F32(a)) != 0; }
uint32_t rl_mask4_all(rl_u32x4 a) { return _mm_movemask_ps(F32(a)) == 15; }
uint32_t rl_mask4_bits(rl_u32x4 a) { return (uint32_t)_mm_movemask_ps(F32(a)); }

uint32_t rl_mask4_pop_count(rl_u32x4 a) {
    return (uint32_t)__builtin_popcount(rl_mask4_bits(a));
}

#undef F32
#undef I32
#undef U32
#undef INT
