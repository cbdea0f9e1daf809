// Counts executed instructions by tag: a TCG plugin for qemu-user 7.2 (plugin API 1).
//
// In: a single-threaded program that calls syscall(9999, tag) where another part of it begins. Out:
// to the file of the option `out=`, a line "tag N instructions I visits V" for each tag below
// TAG_COUNT; with `hot=N`, lines "hot I SYMBOL" of the N symbols in which most instructions were
// executed, of the tag `tag=` or of all but 0. A block of translated code adds its length to one
// counter as it begins, so that every instruction counts once, and counts repeat to the last digit.
//
// Built by bench/count: gcc -O2 -shared -fPIC. The plugin's interface is declared here, because
// distributions do not ship qemu-plugin.h.

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef uint64_t plugin_id;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
typedef void block_callback(plugin_id, struct qemu_plugin_tb *);
typedef void end_callback(plugin_id, void *);
typedef void call_callback(plugin_id, unsigned vcpu, int64_t number, uint64_t, uint64_t, uint64_t,
                           uint64_t, uint64_t, uint64_t, uint64_t, uint64_t);
enum { inline_add_u64 = 0 };

void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id, block_callback *);
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb *, int operation,
                                              void *counter, uint64_t operand);
void qemu_plugin_register_vcpu_syscall_cb(plugin_id, call_callback *);
void qemu_plugin_register_atexit_cb(plugin_id, end_callback *, void *);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *, size_t index);
const char *qemu_plugin_insn_symbol(const struct qemu_plugin_insn *);

#define EXPORTED __attribute__((visibility("default")))
#define TAG_COUNT 4096
#define MARK_CALL 9999

EXPORTED int qemu_plugin_version = 1;

// Executed instructions of the whole program; blocks add to it as they begin.
static uint64_t executed;
static uint64_t executed_at_mark;
static uint64_t by_tag[TAG_COUNT];
static uint64_t visits[TAG_COUNT];
static unsigned tag_now;

static const char *out_path;
static unsigned hot_count;
static long hot_tag = -1;

// For the hottest symbols: a block of translated code.
struct block {
    struct block *next;
    char *symbol;
    uint64_t executed; // Instructions, of this block alone.
    uint64_t executed_at_mark;
    uint64_t wanted; // Those of them that the options ask for.
};
static struct block *blocks;

static void *allocate(size_t size)
{
    void *memory = calloc(1, size);
    if (memory == NULL) {
        fputs("count: out of memory\n", stderr);
        exit(1);
    }
    return memory;
}

static char *copy_of(const char *text)
{
    size_t size = strlen(text) + 1;
    return memcpy(allocate(size), text, size);
}

static void count_block(plugin_id id, struct qemu_plugin_tb *tb)
{
    (void)id;
    size_t length = qemu_plugin_tb_n_insns(tb);
    qemu_plugin_register_vcpu_tb_exec_inline(tb, inline_add_u64, &executed, length);
    if (hot_count == 0) return;
    struct block *block = allocate(sizeof *block);
    const char *symbol = qemu_plugin_insn_symbol(qemu_plugin_tb_get_insn(tb, 0));
    block->symbol = copy_of(symbol != NULL && *symbol != '\0' ? symbol : "?");
    block->next = blocks;
    blocks = block;
    qemu_plugin_register_vcpu_tb_exec_inline(tb, inline_add_u64, &block->executed, length);
}

// Gives the tag that ends what was executed since it began.
static void settle(void)
{
    by_tag[tag_now] += executed - executed_at_mark;
    executed_at_mark = executed;
    bool wanted = hot_tag < 0 ? tag_now != 0 : tag_now == (unsigned long)hot_tag;
    for (struct block *block = blocks; block != NULL; block = block->next) {
        if (wanted) block->wanted += block->executed - block->executed_at_mark;
        block->executed_at_mark = block->executed;
    }
}

static void on_call(plugin_id id, unsigned vcpu, int64_t number, uint64_t tag, uint64_t b,
                    uint64_t c, uint64_t d, uint64_t e, uint64_t f, uint64_t g, uint64_t h)
{
    (void)id, (void)vcpu, (void)b, (void)c, (void)d, (void)e, (void)f, (void)g, (void)h;
    if (number != MARK_CALL) return;
    settle();
    tag_now = tag < TAG_COUNT ? (unsigned)tag : 0;
    visits[tag_now]++;
}

static int by_symbol(const void *a, const void *b)
{
    return strcmp((*(struct block *const *)a)->symbol, (*(struct block *const *)b)->symbol);
}

static int by_heat(const void *a, const void *b)
{
    uint64_t one = (*(struct block *const *)a)->wanted;
    uint64_t other = (*(struct block *const *)b)->wanted;
    return one < other ? 1 : one > other ? -1 : by_symbol(a, b);
}

// Blocks of a symbol are added up in the first of them.
static void write_hottest(FILE *out)
{
    size_t count = 0;
    for (struct block *block = blocks; block != NULL; block = block->next) count++;
    if (count == 0) return;
    struct block **sorted = allocate(count * sizeof *sorted);
    size_t index = 0;
    for (struct block *block = blocks; block != NULL; block = block->next) sorted[index++] = block;
    qsort(sorted, count, sizeof *sorted, by_symbol);
    size_t symbol_count = 0;
    for (index = 0; index < count; index++) {
        struct block *last = symbol_count > 0 ? sorted[symbol_count - 1] : NULL;
        if (last != NULL && strcmp(last->symbol, sorted[index]->symbol) == 0) {
            last->wanted += sorted[index]->wanted;
        } else {
            sorted[symbol_count++] = sorted[index];
        }
    }
    qsort(sorted, symbol_count, sizeof *sorted, by_heat);
    for (index = 0; index < symbol_count && index < hot_count; index++) {
        if (sorted[index]->wanted == 0) break;
        fprintf(out, "hot %llu %s\n", (unsigned long long)sorted[index]->wanted,
                sorted[index]->symbol);
    }
    free(sorted);
}

static void on_end(plugin_id id, void *unused)
{
    (void)id, (void)unused;
    settle();
    FILE *out = fopen(out_path, "w");
    if (out == NULL) {
        perror(out_path);
        return;
    }
    for (unsigned tag = 0; tag < TAG_COUNT; tag++) {
        if (by_tag[tag] == 0) continue;
        fprintf(out, "tag %u instructions %llu visits %llu\n", tag,
                (unsigned long long)by_tag[tag], (unsigned long long)visits[tag]);
    }
    write_hottest(out);
    if (fclose(out) != 0) perror(out_path);
}

// The information about qemu is not looked at.
EXPORTED int qemu_plugin_install(plugin_id id, const void *qemu, int count, char **options)
{
    (void)qemu;
    for (int index = 0; index < count; index++) {
        const char *option = options[index];
        const char *value = strchr(option, '=');
        if (value++ == NULL) return -1;
        if (strncmp(option, "out=", 4) == 0) out_path = copy_of(value);
        else if (strncmp(option, "hot=", 4) == 0) hot_count = (unsigned)strtoul(value, NULL, 10);
        else if (strncmp(option, "tag=", 4) == 0) hot_tag = strtol(value, NULL, 10);
        else return -1;
    }
    if (out_path == NULL) return -1;
    qemu_plugin_register_vcpu_tb_trans_cb(id, count_block);
    qemu_plugin_register_vcpu_syscall_cb(id, on_call);
    qemu_plugin_register_atexit_cb(id, on_end, NULL);
    return 0;
}
