// Nothing here: what a sketch prints is left away.
static void USBprintf(const char *, ...) {}
#define USBprint USBprintf
