/* The intrinsics backend of the target's architecture; each has a file of its own.
 *
 * Link-time optimization inlines every function here into the Zig code that calls it.
 */
#include "intrinsics.h"

#if defined(__ARM_NEON)
#include "intrinsics_neon.h"
#elif defined(__SSE2__)
#include "intrinsics_sse.h"
#else
#error "Raylane needs NEON or SSE2"
#endif
