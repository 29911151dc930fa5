/* random.c SEED SECONDS [FILE [CONTROL [MOST]]]: feeds calls.c random programs where libFuzzer is not there. FILE gets
 * the seed of the program that runs: `random SEED 0` runs that one alone. CONTROL, "double" or "overflow", breaks a
 * promise. MOST: bytes of a program at most (4096); a long one takes up to a minute. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
void shutterbug_fuzz_statistics(void);
void shutterbug_fuzz_control(const char *name);

static uint64_t state;
static uint32_t next(void) { /* splitmix64 */
    uint64_t z = state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return (uint32_t)(z >> 32);
}

int main(int argc, char **argv) {
    uint64_t seed = argc > 1 ? strtoull(argv[1], NULL, 10) : 1;
    double limit_s = argc > 2 ? atof(argv[2]) : 5;
    size_t most = argc > 5 ? strtoull(argv[5], NULL, 10) : 4096;
    static uint8_t data[4096];
    struct timespec start, now;
    clock_gettime(CLOCK_MONOTONIC, &start);
    unsigned long programs = 0;
    do {
        state = seed;
        FILE *note = argc > 3 && argv[3][0] ? fopen(argv[3], "w") : NULL;
        if (note) fprintf(note, "%llu\n", (unsigned long long)seed), fclose(note);
        size_t size = 64 + next() % (sizeof data - 64);
        if (size > most) size = most;
        for (size_t i = 0; i < size; ++i) data[i] = (uint8_t)next();
        LLVMFuzzerTestOneInput(data, size);
        if (argc > 4 && argv[4][0]) shutterbug_fuzz_control(argv[4]);
        ++programs, ++seed;
        clock_gettime(CLOCK_MONOTONIC, &now);
    } while ((double)(now.tv_sec - start.tv_sec) + (now.tv_nsec - start.tv_nsec) * 1e-9 < limit_s);
    shutterbug_fuzz_statistics();
    printf("%lu programs\n", programs);
    return 0;
}
