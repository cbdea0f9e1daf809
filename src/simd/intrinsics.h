/* The operations of the intrinsics backend: four lanes, one function an operation.
 *
 * In and out: 16-byte vectors, passed in registers; intrinsics.zig declares the same functions
 * and says what each computes. A mask lane is all ones or all zeros. Compile with
 * -ffp-contract=off: exact operations must not fuse.
 */
#ifndef RL_SIMD_INTRINSICS_H
#define RL_SIMD_INTRINSICS_H

#include <stdint.h>

typedef float rl_f32x4 __attribute__((vector_size(16)));
typedef int32_t rl_i32x4 __attribute__((vector_size(16)));
typedef uint32_t rl_u32x4 __attribute__((vector_size(16)));

rl_f32x4 rl_f32x4_add(rl_f32x4 a, rl_f32x4 b);
rl_f32x4 rl_f32x4_sub(rl_f32x4 a, rl_f32x4 b);
rl_f32x4 rl_f32x4_mul(rl_f32x4 a, rl_f32x4 b);
rl_f32x4 rl_f32x4_div(rl_f32x4 a, rl_f32x4 b);
rl_f32x4 rl_f32x4_sqrt(rl_f32x4 a);
rl_f32x4 rl_f32x4_neg(rl_f32x4 a);
rl_f32x4 rl_f32x4_abs(rl_f32x4 a);
rl_f32x4 rl_f32x4_copy_sign(rl_f32x4 a, rl_f32x4 b);
rl_f32x4 rl_f32x4_mul_add(rl_f32x4 a, rl_f32x4 b, rl_f32x4 c);
rl_f32x4 rl_f32x4_min(rl_f32x4 a, rl_f32x4 b);
rl_f32x4 rl_f32x4_max(rl_f32x4 a, rl_f32x4 b);
rl_f32x4 rl_f32x4_min_fast(rl_f32x4 a, rl_f32x4 b);
rl_f32x4 rl_f32x4_max_fast(rl_f32x4 a, rl_f32x4 b);
rl_u32x4 rl_f32x4_eq(rl_f32x4 a, rl_f32x4 b);
rl_u32x4 rl_f32x4_lt(rl_f32x4 a, rl_f32x4 b);
rl_u32x4 rl_f32x4_le(rl_f32x4 a, rl_f32x4 b);
rl_f32x4 rl_f32x4_select(rl_u32x4 mask, rl_f32x4 a, rl_f32x4 b);
rl_f32x4 rl_f32x4_interleave_low(rl_f32x4 a, rl_f32x4 b);
rl_f32x4 rl_f32x4_interleave_high(rl_f32x4 a, rl_f32x4 b);
float rl_f32x4_reduce_min(rl_f32x4 a);
float rl_f32x4_reduce_max(rl_f32x4 a);
rl_i32x4 rl_f32x4_to_i32(rl_f32x4 a);

rl_i32x4 rl_i32x4_add(rl_i32x4 a, rl_i32x4 b);
rl_i32x4 rl_i32x4_sub(rl_i32x4 a, rl_i32x4 b);
rl_i32x4 rl_i32x4_min(rl_i32x4 a, rl_i32x4 b);
rl_i32x4 rl_i32x4_max(rl_i32x4 a, rl_i32x4 b);
rl_i32x4 rl_i32x4_and(rl_i32x4 a, rl_i32x4 b);
rl_i32x4 rl_i32x4_or(rl_i32x4 a, rl_i32x4 b);
rl_i32x4 rl_i32x4_xor(rl_i32x4 a, rl_i32x4 b);
rl_i32x4 rl_i32x4_mul(rl_i32x4 a, rl_i32x4 b);
rl_i32x4 rl_i32x4_shift_left(rl_i32x4 a, uint32_t amount);
rl_i32x4 rl_i32x4_shift_right(rl_i32x4 a, uint32_t amount);
rl_u32x4 rl_i32x4_eq(rl_i32x4 a, rl_i32x4 b);
rl_u32x4 rl_i32x4_lt(rl_i32x4 a, rl_i32x4 b);
rl_u32x4 rl_i32x4_le(rl_i32x4 a, rl_i32x4 b);
rl_i32x4 rl_i32x4_select(rl_u32x4 mask, rl_i32x4 a, rl_i32x4 b);
rl_f32x4 rl_i32x4_to_f32(rl_i32x4 a);

rl_u32x4 rl_mask4_and(rl_u32x4 a, rl_u32x4 b);
rl_u32x4 rl_mask4_or(rl_u32x4 a, rl_u32x4 b);
rl_u32x4 rl_mask4_not(rl_u32x4 a);
rl_u32x4 rl_mask4_and_not(rl_u32x4 a, rl_u32x4 b);
rl_u32x4 rl_mask4_from_bits(uint32_t bits);
/* 0 or 1. Not _Bool, which Zig and C lower to different types of LLVM on x86, and functions that
 * differ so are not inlined. */
uint32_t rl_mask4_any(rl_u32x4 a);
uint32_t rl_mask4_all(rl_u32x4 a);
uint32_t rl_mask4_bits(rl_u32x4 a);
uint32_t rl_mask4_pop_count(rl_u32x4 a);

#endif
