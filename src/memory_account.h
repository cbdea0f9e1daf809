/* What a C library allocates by. src/memory_account.zig fills it in: `Hooks`. */
#ifndef RL_MEMORY_ACCOUNT_H
#define RL_MEMORY_ACCOUNT_H

#include <stddef.h>

typedef struct rl_memory {
    void *user;
    /* Memory of 16-byte alignment, for size 0 as well; NULL when there is none left. */
    void *(*allocate)(void *user, size_t size);
    /* As realloc: `memory` may be NULL; where NULL is returned it stays as it was. */
    void *(*resize)(void *user, void *memory, size_t size);
    /* As free: `memory` may be NULL. */
    void (*release)(void *user, void *memory);
} rl_memory;

#endif
