// flk_lane_result as a function, called through ctypes (test_lane_result.py).
#include <cstdint>

#include "Vtop.h"
#include "verilated.h"

// s, colour: n inputs. pixel: n outputs.
extern "C" void run(int64_t n, const uint32_t* s, const uint64_t* colour, uint64_t* pixel) {
  static VerilatedContext context;
  static Vtop model{&context};
  for (int64_t i = 0; i < n; i++) {
    model.s_i = s[i];
    model.colour_i = colour[i];
    model.take_i = 1;
    model.clk_i = 0;
    model.eval();
    model.clk_i = 1;
    model.eval();
    if (FLK_REGISTERED) {  // what comes next and is not taken changes nothing
      model.s_i = ~s[i];
      model.colour_i = ~colour[i];
      model.take_i = 0;
      model.clk_i = 0;
      model.eval();
      model.clk_i = 1;
      model.eval();
    }
    pixel[i] = model.pixel_o;
  }
}
