/* Both converters of the phase servo by hand: what `run_converters` of its controller.py is measured against.
 *
 * The same logic in the same order, so that both end on the same bits; everything that changes lives in local variables
 * of the machine's own width, and the pulses are worked out only where the gate is open. converters_registers.h, the
 * declarations of the structures, is generated from the register files.
 */
#include <stdint.h>

#include "converters_registers.h"

int64_t run_converters(const ConverterParams *restrict p, Converters *restrict r,
                       int64_t start, int64_t rate, int64_t ticks)
{
    const uint32_t carrier_mask = (uint32_t)p->carrier.mask, slot_shift = (uint32_t)p->carrier.shift;
    const uint32_t slot_mask = (1u << slot_shift) - 1, phase_shift = 29 - slot_shift;
    const uint32_t tracking_mask = (uint32_t)p->tracking.mask, tracking_top = (uint32_t)p->tracking.top;
    const uint32_t absolute_mask = (uint32_t)p->absolute.mask, absolute_top = (uint32_t)p->absolute.top;
    const uint32_t leave_antiphase = p->tracking.leave_antiphase;
    Converters c = *r;
    uint32_t count = c.carrier.count, delayed_msb = c.carrier.delayed_msb, switches = c.carrier.switches;
    uint32_t reference = c.tracking.reference, gate = c.tracking.gate, plus = c.tracking.plus, minus = c.tracking.minus;
    uint32_t ps_first = c.tracking.ps_first, ps_second = c.tracking.ps_second;
    uint32_t msb_first = c.tracking.msb_first, msb_second = c.tracking.msb_second;
    uint32_t free = c.absolute.free, msb = c.absolute.msb, latched = c.absolute.latched;
    uint32_t gated = c.absolute.gated, word = c.absolute.word, phase = (uint32_t)start;
    int64_t net = 0;

    for (int64_t k = 0; k < ticks; k++) {
        /* carrier generator */
        count = (count + 1) & carrier_mask;
        if ((count & slot_mask) == 0) {
            uint32_t slot = count >> slot_shift, b3 = slot >> 2, b2 = slot >> 1 & 1, b1 = slot & 1;
            if (b2 && !b1)
                delayed_msb = b3;
            switches = (b3 ^ b2) | (b3 ^ b1) << 1 | (delayed_msb ^ b2 ^ 1) << 2 | (delayed_msb ^ b1) << 3;
        }
        uint32_t ps = (phase + (count << phase_shift)) >> 31;

        /* absolute converter: latch first, then clear */
        uint32_t before = msb;
        free = (free + 1) & absolute_mask;
        msb = free >> absolute_top;
        latched = msb & (before ^ 1);
        if (latched) {
            word = gated;
            gated = 0;
        }
        gated += msb ^ ps;

        /* tracking converter */
        gate = msb_first & (msb_second ^ 1);
        plus = minus = 0;
        if (gate) {
            plus = ps_second & (ps_first | leave_antiphase);
            minus = (ps_first | ps_second) ^ 1;
            net += (int32_t)(plus - minus);
        }
        reference = (reference + 1 + plus - minus) & tracking_mask;
        ps_second = ps_first;
        ps_first = ps;
        msb_second = msb_first;
        msb_first = reference >> tracking_top;

        phase += (uint32_t)rate;
    }
    c.carrier.count = (uint16_t)count, c.carrier.delayed_msb = (uint8_t)delayed_msb;
    c.carrier.switches = (uint8_t)switches;
    c.tracking.reference = (uint16_t)reference, c.tracking.gate = (uint8_t)gate;
    c.tracking.plus = (uint8_t)plus, c.tracking.minus = (uint8_t)minus;
    c.tracking.ps_first = (uint8_t)ps_first, c.tracking.ps_second = (uint8_t)ps_second;
    c.tracking.msb_first = (uint8_t)msb_first, c.tracking.msb_second = (uint8_t)msb_second;
    c.absolute.free = (uint16_t)free, c.absolute.msb = (uint8_t)msb, c.absolute.latched = (uint8_t)latched;
    c.absolute.gated = (uint16_t)gated, c.absolute.word = (uint16_t)word;
    *r = c;
    return net;
}
