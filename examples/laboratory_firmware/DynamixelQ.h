// Stands in for the board and the servo libraries of an OpenCM9.04: every speed word on stdout, with its
// servo and the simulated time since the first that is not zero.
#include <cstdio>
#include <cstdlib>
typedef unsigned char byte, uint8;
typedef unsigned short word;
enum { DXL_BAUD_1000000, BOARD_LED_OFF, BOARD_LED_ON, DXL_LED_OFF, DXL_PRESENT_POSITION, DXL_MAX_TORQUE_LIMIT = 1023 };
static unsigned long now_us = 1;
static void delayMicroseconds(unsigned long us) { if ((now_us += us) > 3600000000UL) exit(0); }
static void delay(unsigned long ms) { delayMicroseconds(1000 * ms); }
static void msDelay(unsigned long ms) { delay(ms); }
static unsigned long micros() { return ++now_us; }
// One key, a space, is pressed; whoever waits for a second one has finished.
static struct { int keys = 1; byte read() { if (keys-- == 0) exit(0); return ' '; } } SerialUSB;
static bool usbBytesAvailable() { return true; }
static struct { void setLED(int) {} } Board;
static struct {
  unsigned long start_us = 0;
  void setSpeed(const byte *ids, int n, const word *words) {
    for (int i = 0; i < n; i++) {
      if (!start_us && words[i] % 1024) start_us = now_us;
      printf("%lu %d %d\n", start_us ? now_us - start_us : 0, ids[i], words[i]);
    }
  }
  void setSpeed(const byte *ids, int n, word one) { for (int i = 0; i < n; i++) setSpeed(ids + i, 1, &one); }
  // Two packets of 8 bytes each way a servo at 1 Mbit/s.
  void readWord(const byte *, int n, int, word *values) { for (int i = 0; i < n; i++) values[i] = 512; delayMicroseconds(160 * n); }
  void getPosition(const byte *ids, int n, word *values) { readWord(ids, n, 0, values); }
  byte ping(byte id) { return id; }
  void begin(int) {} void setLED(int) {} void setWheelMode(const byte *, int) {} void setPosition(byte, word) {}
  void setReturnDelay(const byte *, int, byte) {} void setLoad(const byte *, int, word) {}
} Dxl;
void setup(void);
void loop(void);
int main() { setup(); for (;;) loop(); }
