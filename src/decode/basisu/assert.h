/* What the transcoder asserts of its tables and indices, it would else take for granted of files
 * that are broken, too: where it does not hold, it is left (see ../basisu.cpp). Included anew
 * wherever the C library's header would be.
 */
#undef assert
#define assert(condition) ((condition) ? (void)0 : rl_fail())
