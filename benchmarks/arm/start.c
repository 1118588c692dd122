/* Starts a program on a Cortex-M with a floating-point unit. */
#include <stdint.h>

extern uint32_t data_start, data_end, data_load, bss_start, bss_end, stack_top;
extern int main(void);
void Reset_Handler(void);
#ifdef SEMIHOSTING
extern void initialise_monitor_handles(void);
extern void exit(int);
#endif

__attribute__((section(".vectors"), used)) static const uintptr_t vectors[2] = {
    (uintptr_t)&stack_top, (uintptr_t)Reset_Handler
};

void Reset_Handler(void)
{
    uint32_t *from = &data_load, *to;
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20; /* lets it use the floating-point unit */
    for (to = &data_start; to < &data_end;) *to++ = *from++;
    for (to = &bss_start; to < &bss_end;) *to++ = 0;
#ifdef SEMIHOSTING
    initialise_monitor_handles();
    exit(main());
#else
    main();
    for (;;) { }
#endif
}
