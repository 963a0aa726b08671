/* A header's rule on an ATmega1284P: what every call returns, where the motor stands then, its period, and the cycles.
 *
 * Timer 1 counts the processor's cycles; a line for each call leaves by the serial port, which simavr prints.
 */
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdio.h>

#include HEADER

static M(registers) motor;

static int put(char one, FILE *stream)
{
    (void)stream;
    while (!(UCSR0A & (1U << UDRE0))) {
    }
    UDR0 = (uint8_t)one;
    return 0;
}

static FILE console = FDEV_SETUP_STREAM(put, 0, _FDEV_SETUP_WRITE);

/* One period is over; two readings of the timer with nothing between them take `empty` cycles. */
static int call(uint16_t empty)
{
    const uint16_t begin = TCNT1;
    const int outcome = M(next)(&motor);
    const uint16_t cycles = (uint16_t)(TCNT1 - begin - empty);

    fprintf(&console, "%d %ld %ld %u\n", outcome, (long)motor.rule.position, (long)motor.timer.period, cycles);
    return outcome;
}

int main(void)
{
    uint16_t empty;

    UCSR0A = 1U << U2X0;
    UCSR0B = 1U << TXEN0;
    TCCR1B = 1;
    empty = TCNT1;
    empty = (uint16_t)(TCNT1 - empty);
    M(place)(&motor, 0);
    ORDERS
    sleep_mode(); /* with interrupts off: simavr ends */
}
