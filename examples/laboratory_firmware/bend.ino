// One wave that bends the worm: wheels 1 to 6 wind and pay out one after the other, and wheels 7 to 12 rest.
#include "DynamixelQ.h"
#include "USBprint.h"

const byte SEGMENTS = 6;
const word WIND = 0x400, SPEED = 700;
byte ids[2 * SEGMENTS];

void setup() {
  Dxl.begin(DXL_BAUD_1000000);
  for (byte i = 0; i < 2 * SEGMENTS; i++) ids[i] = i + 1;
  Dxl.setWheelMode(ids, 2 * SEGMENTS);
}

void loop() {
  static byte segment = 0;
  byte moving[] = {ids[segment], ids[(segment + SEGMENTS - 1) % SEGMENTS]};
  word speeds[] = {WIND | SPEED, SPEED};
  Dxl.setSpeed(moving, segment ? 2 : 1, speeds);
  delay(1700);
  Dxl.setSpeed(ids, 2 * SEGMENTS, (word)0);
  if (++segment == SEGMENTS) delay(4000000);
}
