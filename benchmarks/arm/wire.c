/* A controller behind the first serial port of Arm's MPS2 boards, at one end of annelid's protocol (docs/wire.md).
 *
 * wire_names.h has the names of one firmware: its header, RECEIVE, ELAPSED, INIT and ANSWER.
 */
#include <stddef.h>
#include <stdint.h>

#include "wire_names.h"

#define UART ((volatile uint32_t *)0x40004000u) /* data, state, control, interrupts, divider */
#define SYSTICK ((volatile uint32_t *)0xE000E010u)
#define TICKS_PER_MS 25000u

int main(void)
{
    static unsigned char answer[ANSWER];
    uint32_t before, now, ticks = 0;
    UART[4] = 16;
    UART[2] = 3;
    SYSTICK[1] = 0xFFFFFFu;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    before = SYSTICK[2];
    INIT();
    for (;;) {
        size_t i, n = (UART[1] & 2) ? RECEIVE((unsigned char)UART[0], answer) : 0;
        for (i = 0; i < n; i++) {
            while (UART[1] & 1) { }
            UART[0] = answer[i];
        }
        now = SYSTICK[2];
        ticks += (before - now) & 0xFFFFFFu;
        before = now;
        ELAPSED(ticks / TICKS_PER_MS);
        ticks %= TICKS_PER_MS;
    }
}
