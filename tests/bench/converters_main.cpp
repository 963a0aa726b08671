// Runs the circuit of converters.v, compiled by Verilator, on request.
//
// Each line of the standard input asks for one run from power-on: start, rate, ticks (at least 1). The answer is one
// line: nanoseconds of processor time, net pulses, and the end state as `Converters` in hexadecimal. The loop that is
// timed sets the clock and evaluates, nothing else. CLOCKS and BITS are given by the build: periods of the circuit's
// clock per tick, width of the counters.
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <ctime>

#include "Vcircuit.h"
#include "verilated.h"

#include "converters_registers.h"

namespace {

inline void tick(Vcircuit &c)
{
    for (int k = 0; k < CLOCKS; k++) {
        c.clock = 0;
        c.eval();
        c.clock = 1;
        c.eval();
    }
}

void power_on(Vcircuit &c, uint32_t start, uint32_t rate)
{
    c.start = start;
    c.rate = rate;
    c.clear = 1;
    tick(c);
    c.clear = 0;
    c.eval();
}

Converters read_lines(const Vcircuit &c)  // what shows before the edge only
{
    Converters s = {};
    s.tracking.gate = c.gate;
    s.tracking.plus = c.plus;
    s.tracking.minus = c.minus;
    s.absolute.latched = c.latch;
    return s;
}

void read_flip_flops(const Vcircuit &c, Converters &s)
{
    s.carrier.count = c.drive_count;
    s.carrier.delayed_msb = c.delayed_msb;
    s.carrier.switches = c.switches;
    s.tracking.reference = c.ref_count;
    s.tracking.ps_first = c.ps_first;
    s.tracking.ps_second = c.ps_second;
    s.tracking.msb_first = c.msb_first;
    s.tracking.msb_second = c.msb_second;
    s.absolute.free = c.free_count;
    s.absolute.msb = c.free_count >> (BITS - 1) & 1;
    s.absolute.gated = c.gated_count;
    s.absolute.word = c.word;
}

}  // namespace

int main()
{
    int64_t start, rate, ticks;
    while (std::scanf("%" SCNd64 " %" SCNd64 " %" SCNd64, &start, &rate, &ticks) == 3) {
        VerilatedContext context;
        Vcircuit circuit{&context};
        power_on(circuit, static_cast<uint32_t>(start), static_cast<uint32_t>(rate));
        std::clock_t begin = std::clock();
        for (int64_t k = 1; k < ticks; k++)
            tick(circuit);
        double taken = static_cast<double>(std::clock() - begin) * (1e9 / CLOCKS_PER_SEC);
        Converters state = read_lines(circuit);
        tick(circuit);
        read_flip_flops(circuit, state);
        circuit.final();
        std::printf("%.0f %" PRId32 " ", taken, static_cast<int32_t>(circuit.net));
        unsigned char bytes[sizeof state];
        std::memcpy(bytes, &state, sizeof state);
        for (unsigned char byte : bytes)
            std::printf("%02x", byte);
        std::printf("\n");
        std::fflush(stdout);
    }
}
