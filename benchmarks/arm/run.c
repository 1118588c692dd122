/* Steps a firmware through recorded sensors and prints all potentials after every block, as the bits that they are.
 *
 * First it prints the ticks of SysTick that 2,000,000 instructions take, last those of all steps.
 */
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "record.h"

#define SYSTICK ((volatile uint32_t *)0xE000E010u)

static uint32_t since(uint32_t before) { return (before - SYSTICK[2]) & 0xFFFFFFu; }

int main(void)
{
    static sensors_type sensors;
    static activation_type activation;
    uint64_t ticks = 0;
    uint32_t before, count = 1000000;
    int block, i;
    SYSTICK[1] = 0xFFFFFFu;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    before = SYSTICK[2];
    __asm volatile("1: subs %0, #1\n bne 1b" : "+r"(count) : : "cc");
    printf("%lu\n", (unsigned long)since(before));
    INIT();
    for (block = 0; block < N_BLOCKS; block++) {
        memcpy(&sensors, record[block], sizeof sensors);
        before = SYSTICK[2];
        for (i = 0; i < STEPS; i++) STEP(&sensors, &activation);
        ticks += since(before);
        for (i = 0; i < N_NEURONS; i++) {
            uint32_t words[2] = {0, 0};
            memcpy(words, &NOW.potential_mV[i], sizeof NOW.potential_mV[i]);
            printf("%08lx%08lx\n", (unsigned long)words[1], (unsigned long)words[0]);
        }
    }
    printf("%lu\n", (unsigned long)ticks);
    return 0;
}
