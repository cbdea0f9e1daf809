/* In the place of the source of basisu_xbc7_decoder.h: nothing. */
