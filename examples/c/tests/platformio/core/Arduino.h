// What the sketch uses of the Arduino language, on firmware/hal.c.
#pragma once
#include <math.h>
#include <stddef.h>
#include <stdint.h>

enum { LOW, HIGH, OUTPUT };
uint32_t micros();
inline void pinMode(int, int) {}
inline void digitalWrite(int, int) {}
struct Port {
    void begin(unsigned long) {}
    bool available();
    int read();
    size_t write(const uint8_t *bytes, size_t length);
    void flush() {}
};
extern Port Serial1;
void setup();
void loop();
