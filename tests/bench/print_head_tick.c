/* The averaged print-head tick by hand: what `detent.methods.print_head.system.advance` is measured against.
 *
 * The same arithmetic in the same order, so that both end on the same bits (compile with -ffp-contract=off). It covers
 * what print lines at high speed and their turn-arounds reach; anything else - command bytes, homing, identification,
 * low speed, faults, the switch-level bridge - ends the run with NOT_COVERED. print_head_registers.h, the declarations
 * of the structures, is generated from the register files.
 */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "print_head_registers.h"

#define NOT_COVERED INT64_C(-1)
#define NEVER (INT64_C(1) << 62)

enum { PERIOD_US = 40, STALL_US = 50000, TRIM_US = 16000, RUNAWAY_US = 62, REVERSAL_US = 800, TURN_AROUND_US = 133000 };
enum { EDGES = 64, FIRES = 4 };
enum { COLUMNS = 2048, HALF_EMITTER = 128, STATUS_QUEUE = 32, COMMAND_QUEUE = 4 };
enum { FLOOR = 30, HIGH_SPEED = 60, STALL_MARGIN = 20, RUN_UP_RESERVE = 12 };
enum {
    POWER_ON, HOME_LEFT, HOME_RIGHT, IDLE, LOW_START, LOW_STEADY, LOW_STOP,
    HIGH_ACCEL, HIGH_STEADY, HIGH_TRANSITION, HIGH_REVERSE, FAULT
};
enum { NO_OPERATION, PRINT, RUN, SET_SPEED, CONTROLLED_RUN };
enum { OK = 0, OUT_OF_RANGE = 2 };

/* A run: parameters, state, and whether it has met something that is not covered. */
typedef struct {
    const PrintHeadParams *restrict p;
    PrintHead *restrict r;
    bool lost;
} Axis;

static inline int64_t least(int64_t a, int64_t b) { return a < b ? a : b; }
static inline int64_t most(int64_t a, int64_t b) { return a > b ? a : b; }

static inline int64_t floor_div(int64_t a, int64_t b)
{
    int64_t q = a / b;
    return q - ((a % b != 0) && ((a < 0) != (b < 0)));
}

/* ---- encoder ------------------------------------------------------------------------------------------------ */

static inline double uniform(NoiseSource *r)
{
    r->state = (int64_t)((uint64_t)r->state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407));
    return (double)((r->state >> 33) & 0x7FFFFFFF) * (1.0 / 2147483648.0);
}

static inline double fresh_jitter(const EncoderParams *p, Encoder *e)
{
    if (p->jitter <= 0.0)
        return 0.0;
    double a = uniform(&e->noise), b = uniform(&e->noise), c = uniform(&e->noise);
    double jitter = p->jitter * (2.0 * (a + b + c) - 3.0);
    return jitter < -0.45 ? -0.45 : jitter > 0.45 ? 0.45 : jitter;
}

static inline void pass_edge(const EncoderParams *p, Encoder *e, bool rightward)
{
    if (rightward) {
        e->edge++;
        e->below = e->above;
        e->next_left = e->next_right;
        e->above = fresh_jitter(p, e);
        e->next_right = ((double)(e->edge + 1) + e->above) * p->edge_pitch + p->origin;
    } else {
        e->edge--;
        e->above = e->below;
        e->next_right = e->next_left;
        e->below = fresh_jitter(p, e);
        e->next_left = ((double)e->edge + e->below) * p->edge_pitch + p->origin;
    }
    unsigned a = ~(unsigned)e->edge >> 1 & 1u;
    if (p->missing > 0.0) {
        if (!a)
            e->masked = 0;
        else if (!e->channel_a && !e->masked)
            e->masked = uniform(&e->noise) < p->missing;
        a -= e->masked;
    }
    e->channel_a = (uint8_t)a;
    e->channel_b = (uint8_t)(((unsigned)e->edge + 1u) >> 1 & 1u);
}

static inline int count_edge(Quadrature *q, unsigned a, unsigned b)
{
    int step = (int)(a ^ q->channel_b) - (int)(b ^ q->channel_a);
    q->illegal += a != q->channel_a && b != q->channel_b;
    q->channel_a = (uint8_t)a;
    q->channel_b = (uint8_t)b;
    q->count += step;
    return step;
}

/* ---- columns ------------------------------------------------------------------------------------------------ */

static void skip_white(ColumnTimer *c, const LineBuffer *b, int direction)
{
    const uint8_t *ink = b->ink + c->bank * COLUMNS;
    while (c->active && !ink[c->column]) {
        if (c->column == c->end_column)
            c->active = 0;
        else
            c->column += direction;
    }
}

static void next_column(ColumnTimer *c, const LineBuffer *b, int direction)
{
    c->fire_us = NEVER;
    if (c->column == c->end_column) {
        c->active = 0;
    } else {
        c->column += direction;
        skip_white(c, b, direction);
    }
}

static inline void schedule(const ColumnTimerParams *p, ColumnTimer *c, const LineBuffer *b, int64_t emitter,
                            int direction, int64_t when, int64_t interval)
{
    while (c->active && c->fire_us == NEVER) {
        int64_t place = p->column_zero + (int64_t)c->column * p->column_pitch;
        int64_t ahead = (place - (emitter * 256 - HALF_EMITTER)) * direction - c->lead;
        if (ahead >= 256)
            break;
        if (ahead < 0 || interval <= 0) {
            c->missed++;
            next_column(c, b, direction);
        } else {
            c->fire_us = when + ((ahead * interval + 128) >> 8);
        }
    }
}

static inline void fire_column(PrintHead *r, int64_t within)
{
    HeadComputer *h = &r->controller.head;
    ColumnTimer *c = &h->columns;
    int64_t k = least(r->lines.fired, FIRES - 1);
    r->lines.fired_us[k] = (uint8_t)within;
    r->lines.place[k] = (int16_t)(c->bank * COLUMNS + c->column);
    r->lines.fired = (uint8_t)(k + 1);
    c->fired++;
    next_column(c, &h->buffer, h->direction);
}

/* ---- drive and lines of the computer ------------------------------------------------------------------------ */

static void put_drive(const HeadParams *p, HeadComputer *c, int64_t value)
{
    value = least(most(value, -(int64_t)p->drive_limit), p->drive_limit);
    c->drive_cmd = (int16_t)value;
    c->out.count = (int16_t)(value < 0 ? -value : value);
    c->out.transition = 0;
    if (value != 0)
        c->out.right_left = value > 0;
}

static void put_braking(const HeadParams *p, HeadComputer *c)
{
    if (c->drive > 0 && p->transition) {
        c->drive_cmd = (int16_t)(c->direction * c->drive);
        c->out.count = (int16_t)(300 - c->drive);
        c->out.transition = 1;
        c->out.right_left = c->direction > 0;
    } else if (c->drive > 0) {
        put_drive(p, c, (int64_t)c->direction * c->drive);
    } else {
        c->state = HIGH_REVERSE;
        put_drive(p, c, (int64_t)c->direction * c->drive);
        c->out.right_left = c->direction <= 0;
    }
}

static void begin_steady(HeadComputer *c)
{
    c->state = HIGH_STEADY;
    c->drive = c->steady;
    c->next_trim_us = c->now_us + TRIM_US;
    c->phase_start = c->emitter;
}

static void begin_stop(const HeadParams *p, HeadComputer *c)
{
    if (c->state != HIGH_STEADY) {
        c->drive = (int16_t)(c->drive - p->ir);
    } else if (c->direction > 0) {
        c->kept_speed_right = c->speed;
        c->kept_drive_right = c->drive;
    } else {
        c->kept_speed_left = c->speed;
        c->kept_drive_left = c->drive;
    }
    c->drive = (int16_t)(c->drive - p->ir);
    c->next_ramp_us = c->now_us + c->ramp_us;
    c->state = HIGH_TRANSITION;
    put_braking(p, c);
}

static inline int64_t stop_distance_up(int64_t s) { return (s * s + 143) / 144; }

static inline void move_emitter(const HeadParams *p, HeadComputer *c)
{
    int64_t pace = c->interval_us * c->speed;
    if (c->state == HIGH_ACCEL && 0 < pace && pace <= 20000) {
        begin_steady(c);
        put_drive(p, c, (int64_t)c->direction * c->drive);
    }
    if ((c->target - c->emitter) * c->direction <= stop_distance_up(c->speed))
        begin_stop(p, c);
}

static void trim(const HeadParams *p, HeadComputer *c)
{
    if (p->trim) {
        int64_t passed = (c->emitter - c->phase_start) * c->direction, reference = (204 * c->speed + 128) >> 8;
        c->drive = (int16_t)(c->drive + (passed < reference) - (passed > reference));
        c->phase_start = c->emitter;
    }
    c->drive = (int16_t)least(most(c->drive, 0), p->drive_limit);
}

static void move_timer(const HeadParams *p, HeadComputer *c)
{
    bool due = c->next_ramp_us <= c->now_us;
    switch (c->state) {
    case HIGH_ACCEL:
        if (due && c->drive < c->ramp_top) {
            c->drive++;
            c->next_ramp_us += c->ramp_us;
        }
        if (c->drive >= c->ramp_top && c->next_ramp_us <= c->now_us)
            begin_steady(c);
        put_drive(p, c, (int64_t)c->direction * c->drive);
        break;
    case HIGH_TRANSITION:
    case HIGH_REVERSE:
        if (due) {
            c->drive--;
            c->next_ramp_us += c->ramp_us;
        }
        put_braking(p, c);
        break;
    case HIGH_STEADY:
        if (c->next_trim_us <= c->now_us) {
            c->next_trim_us += TRIM_US;
            trim(p, c);
        }
        put_drive(p, c, (int64_t)c->direction * c->drive);
        break;
    default:
        break;
    }
}

/* ---- the next command --------------------------------------------------------------------------------------- */

static void pass_on(StatusPort *s)
{
    if (s->waiting > 0 && !s->latch.flag) {
        s->latch.byte = s->queue[s->first];
        s->latch.flag = 1;
        s->first = (s->first + 1) & (STATUS_QUEUE - 1);
        s->waiting--;
    }
}

static void send(StatusPort *s, int byte)
{
    if (s->waiting >= STATUS_QUEUE) {
        s->lost++;
        return;
    }
    s->queue[(s->first + s->waiting) & (STATUS_QUEUE - 1)] = (uint8_t)byte;
    s->waiting++;
    pass_on(s);
}

static inline bool is_motion(int operation)
{
    return operation == PRINT || operation == RUN || operation == CONTROLLED_RUN;
}

static bool fits(int64_t distance, int64_t s) { return 5 * s * s < 288 * distance; }
static int64_t slower(int64_t s, int64_t maximum) { return (s >> 1) > FLOOR ? s >> 1 : least(FLOOR, maximum); }
static int64_t run_up(int64_t s) { return (21 * s * s + 2879) / 2880; }
static int64_t size_of(int64_t a) { return a < 0 ? -a : a; }

static void plan_run(HeadComputer *c, int64_t target, int64_t origin, int64_t maximum)
{
    int64_t distance = size_of(target - origin), s = maximum;
    while (s > FLOOR && !fits(distance, s))
        s = slower(s, maximum);
    c->plan.code = 0 <= target && target <= c->width ? OK : OUT_OF_RANGE;
    c->plan.reposition = 0;
    c->plan.direction = target >= origin ? 1 : -1;
    c->plan.target = (int32_t)target;
    c->plan.distance = (int32_t)distance;
    c->plan.speed = (int16_t)s;
}

static int64_t print_distance(const HeadComputer *c, int64_t start, int64_t end, int64_t origin, int64_t s)
{
    int64_t direction = end >= start ? 1 : -1, stop = stop_distance_up(s);
    if ((start - origin) * direction >= run_up(s) || c->repositioned)
        return size_of(end + direction * stop - origin);
    return size_of(end - start) + run_up(s) + RUN_UP_RESERVE + stop;
}

static void plan_print(const HeadParams *p, HeadComputer *c, int64_t start, int64_t end, int64_t origin)
{
    Plan *q = &c->plan;
    int64_t s = c->maximum;
    while (s > FLOOR && !fits(print_distance(c, start, end, origin, s), s))
        s = slower(s, c->maximum);
    q->distance = (int32_t)print_distance(c, start, end, origin, s);
    q->speed = (int16_t)s;
    q->direction = end >= start ? 1 : -1;
    q->target = (int32_t)(end + q->direction * stop_distance_up(s));
    q->reposition = 0;
    q->code = 0 <= q->target && q->target <= c->width ? OK : OUT_OF_RANGE;
    if (q->code != OK || c->repositioned || (start - origin) * q->direction >= run_up(s))
        return;
    int64_t back = least(most(start - q->direction * (run_up(s) + RUN_UP_RESERVE), 0), c->width);
    if ((start - back) * q->direction < run_up(s)) {
        q->code = OUT_OF_RANGE;
        return;
    }
    plan_run(c, back, origin, p->run_speed);
    q->reposition = 1;
}

static void begin_line(const HeadParams *p, HeadComputer *c, bool turn)
{
    int64_t zero = p->columns.column_zero, pitch = p->columns.column_pitch, first, last;
    ColumnTimer *t = &c->columns;
    LineBuffer *b = &c->buffer;
    if (c->direction > 0) {
        first = -floor_div(zero - c->start, pitch);
        last = floor_div((int64_t)c->end * 256 - zero, pitch);
    } else {
        first = floor_div(c->start - zero, pitch);
        last = -floor_div(zero - (int64_t)c->end * 256, pitch);
    }
    t->bank = 1 - t->bank;
    b->speed[t->bank] = c->speed;
    b->direction[t->bank] = c->direction;
    b->turned[t->bank] = turn;
    t->lead = (int32_t)(((int64_t)p->columns.lead_per_speed * c->speed + 128) >> 8);
    t->column = (int32_t)least(most(first, 0), COLUMNS - 1);
    t->end_column = (int32_t)least(most(last, 0), COLUMNS - 1);
    t->active = (last - first) * c->direction >= 0;
    t->fire_us = NEVER;
    skip_white(t, b, c->direction);
}

static int64_t steady_drive(const IdentifiedLine *line, bool with_friction, int64_t s)
{
    return ((line->slope * s) >> 8) + (with_friction ? line->friction : 0);
}

static int64_t steady_value(const HeadParams *p, HeadComputer *c, int direction, int64_t s)
{
    int16_t *kept_speed = direction > 0 ? &c->kept_speed_right : &c->kept_speed_left;
    if (p->memory && s >= HIGH_SPEED && *kept_speed == s)
        return direction > 0 ? c->kept_drive_right : c->kept_drive_left;
    *kept_speed = 0;
    return steady_drive(direction > 0 ? &c->right : &c->left, true, s);
}

static int64_t ramp_interval_us(const HeadParams *p, const HeadComputer *c, int64_t s)
{
    int64_t total = 240 * (steady_drive(&c->right, p->span_steady, s) + steady_drive(&c->left, p->span_steady, s));
    return total <= 0 ? TURN_AROUND_US : (2 * TURN_AROUND_US * s + total) / (2 * total);
}

static void begin_move(const HeadParams *p, HeadComputer *c, bool turn)
{
    int16_t old_drive = c->drive;
    const IdentifiedLine *line = c->plan.direction > 0 ? &c->right : &c->left;
    c->moves++;
    c->direction = c->plan.direction;
    c->speed = c->plan.speed;
    c->target = c->expected_stop = c->plan.target;
    c->last_emitter_us = c->now_us;
    c->emitter_seen = 0;
    c->interval_us = 0;
    c->too_fast = 0;
    c->against = 0;
    c->phase_start = c->emitter;
    c->steady = (int16_t)steady_value(p, c, c->direction, c->speed);
    if (c->operation == PRINT && !c->repositioning)
        begin_line(p, c, turn);
    c->state = HIGH_ACCEL;
    c->ramp_us = (int32_t)ramp_interval_us(p, c, c->speed);
    c->ramp_top = (int16_t)least(c->steady + p->ir, p->drive_limit);
    if (turn) {
        c->turn_arounds++;
        c->drive = (int16_t)((p->friction_jump ? c->right.friction + c->left.friction : 0) - old_drive);
    } else {
        c->drive = (int16_t)(line->friction + p->ir);
        c->next_ramp_us = c->now_us + c->ramp_us;
    }
    put_drive(p, c, (int64_t)c->direction * c->drive);
}

static void stand(const HeadParams *p, HeadComputer *c, int state)
{
    c->drive = 0;
    c->state = (uint8_t)state;
    if (c->direction != 0)
        c->out.right_left = c->direction > 0;
    put_drive(p, c, 0);
}

static bool begin_motion(Axis *a, bool turn)
{
    const HeadParams *p = &a->p->controller;
    HeadComputer *c = &a->r->controller.head;
    if (!c->homed) {
        a->lost = true;
        return false;
    }
    if (c->operation == PRINT)
        plan_print(p, c, c->start >> 8, c->end, c->emitter);
    else
        plan_run(c, c->end, c->emitter, c->operation == RUN ? p->run_speed : least(c->maximum, p->run_speed));
    if (c->plan.code != OK || c->plan.distance == 0) {
        send(&c->status, c->plan.code);
        return false;
    }
    c->repositioning = c->plan.reposition;
    c->repositions += c->plan.reposition;
    bool continues = turn && c->plan.speed == c->speed && c->plan.direction == -c->direction;
    if (!continues)
        stand(p, c, IDLE);
    if (c->plan.speed < HIGH_SPEED) {
        a->lost = true;
        return true;
    }
    begin_move(p, c, continues);
    return true;
}

static void begin_next(Axis *a, bool turn)
{
    HeadComputer *c = &a->r->controller.head;
    CommandQueue *q = &c->queue;
    while (q->waiting > 0) {
        unsigned k = q->first;
        c->operation = (uint8_t)q->operation[k];
        c->start = q->start[k];
        c->end = q->end[k];
        c->repositioned = c->repositioning = 0;
        q->first = (k + 1) & (COMMAND_QUEUE - 1);
        q->waiting--;
        if (!is_motion(c->operation)) {
            a->lost = true;
            return;
        }
        q->motions--;
        if (begin_motion(a, turn))
            return;
        c->operation = NO_OPERATION;
    }
    stand(&a->p->controller, c, c->state == POWER_ON || c->state == FAULT ? c->state : IDLE);
}

static void at_zero_speed(Axis *a)
{
    HeadComputer *c = &a->r->controller.head;
    bool turn = c->state == HIGH_TRANSITION || c->state == HIGH_REVERSE;
    c->columns.active = 0;
    c->columns.fire_us = NEVER;
    c->expected_stop = (int32_t)c->emitter;
    if (c->repositioning) {
        c->repositioned = 1;
        if (begin_motion(a, turn))
            return;
        turn = false;
    } else {
        send(&c->status, OK);
    }
    c->operation = NO_OPERATION;
    begin_next(a, turn);
}

/* ---- interrupts and timers ---------------------------------------------------------------------------------- */

static inline int64_t next_wake(const HeadParams *p, const HeadComputer *c)
{
    int64_t stall = c->last_emitter_us + STALL_US, zero = c->last_emitter_us + p->zero_speed_us;
    switch (c->state) {
    case HIGH_ACCEL: return least(c->next_ramp_us, stall);
    case HIGH_STEADY: return least(c->next_trim_us, stall);
    case HIGH_TRANSITION:
    case HIGH_REVERSE: return least(c->next_ramp_us, zero);
    default: return NEVER;
    }
}

static inline void on_emitter(Axis *a, int64_t when, int change)
{
    HeadComputer *c = &a->r->controller.head;
    c->emitter += change;
    c->interval_us = c->emitter_seen && change == c->last_step ? when - c->last_emitter_us : 0;
    c->last_emitter_us = when;
    c->emitter_seen = 1;
    c->last_step = (int8_t)change;
    c->too_fast = 0 < c->interval_us && c->interval_us < RUNAWAY_US ? c->too_fast + 1 : 0;
    c->against = change != c->direction ? (uint16_t)(c->against + 1) : 0;
    switch (c->state) {
    case POWER_ON:
    case IDLE:
    case FAULT:
        break;
    case HIGH_ACCEL:
    case HIGH_STEADY:
        move_emitter(&a->p->controller, c);
        break;
    case HIGH_TRANSITION:
    case HIGH_REVERSE:
        if (change != c->direction)
            at_zero_speed(a);
        break;
    default:
        a->lost = true;
    }
    a->lost |= c->state != IDLE && c->too_fast >= 2;
    c->wake_us = next_wake(&a->p->controller, c);
    if (c->columns.active && change == c->direction)
        schedule(&a->p->controller.columns, &c->columns, &c->buffer, change > 0 ? c->emitter : c->emitter + 1, change,
                 when, c->interval_us);
}

static void on_reverse_edge(Axis *a)
{
    HeadComputer *c = &a->r->controller.head;
    bool at_speed = 0 < c->interval_us && c->interval_us < REVERSAL_US;
    if ((c->state == HIGH_TRANSITION || c->state == HIGH_REVERSE) && !at_speed)
        at_zero_speed(a);
    c->wake_us = next_wake(&a->p->controller, c);
}

static void on_timer(Axis *a)
{
    const HeadParams *p = &a->p->controller;
    HeadComputer *c = &a->r->controller.head;
    int64_t quiet = c->now_us - c->last_emitter_us;
    if (c->state == HIGH_TRANSITION || c->state == HIGH_REVERSE) {
        if (quiet >= p->zero_speed_us)
            at_zero_speed(a);
        else
            move_timer(p, c);
    } else if ((c->state == HIGH_ACCEL || c->state == HIGH_STEADY) && quiet < STALL_US) {
        move_timer(p, c);
    } else {
        a->lost = true;
    }
    c->wake_us = next_wake(p, c);
}

/* ---- drive ---------------------------------------------------------------------------------------------------- */

static double terminal_voltage(unsigned gates, double supply, bool positive)
{
    double a = gates & 1u ? supply : gates & 4u ? 0.0 : positive ? 0.0 : supply;
    double b = gates & 2u ? supply : gates & 8u ? 0.0 : positive ? supply : 0.0;
    return a - b;
}

static void steer(Bridge *b, const BridgeLines *lines, unsigned pulse, double supply)
{
    if (lines->transition) {
        b->gates_on = lines->right_left ? 4 : 8;
        b->gates_off = 0;
    } else {
        b->gates_on = lines->right_left ? 1 | 8 : 2 | 4;
        b->gates_off = lines->right_left ? 8 : 4;
    }
    b->pulse = (uint16_t)pulse;
    b->on_positive = terminal_voltage(b->gates_on, supply, true);
    b->on_negative = terminal_voltage(b->gates_on, supply, false);
    b->off_positive = terminal_voltage(b->gates_off, supply, true);
    b->off_negative = terminal_voltage(b->gates_off, supply, false);
    double share = pulse / 300.0;
    b->mean_positive = share * b->on_positive + (1.0 - share) * b->off_positive;
    b->mean_negative = share * b->on_negative + (1.0 - share) * b->off_negative;
}

static inline void take_over(const PrintHeadPlantParams *p, PrintHeadPlant *r, const PrintHeadLines *lines)
{
    r->timer.pulse = r->timer.counter = lines->count;
    if (lines->count != r->bridge.pulse || lines->right_left != r->latch.right_left ||
        lines->transition != r->latch.transition) {
        r->latch.right_left = lines->right_left;
        r->latch.transition = lines->transition;
        steer(&r->bridge, &r->latch, lines->count, p->supply);
    }
}

/* ---- plant ------------------------------------------------------------------------------------------------------ */

static inline int sense_of_motion(const DriveTrainParams *p, const DriveTrain *t)
{
    if (t->velocity != 0.0)
        return t->velocity > 0.0 ? 1 : -1;
    double push = p->force_constant * t->current + t->force;
    if (push > p->friction.static_right && t->position < p->right_end)
        return 1;
    if (push < -p->friction.static_left && t->position > p->left_end)
        return -1;
    return 0;
}

static inline void move(const DriveTrainParams *p, DriveTrain *t, double u_positive, double u_negative)
{
    double i = t->current, v = t->velocity, emf = p->emf_constant * v;
    int sense = sense_of_motion(p, t);
    bool positive = i > 0.0 || (i == 0.0 && u_positive > emf);
    bool negative = i < 0.0 || (i == 0.0 && u_negative < emf);
    double u = positive ? u_positive : negative ? u_negative : emf;
    t->sense = (int8_t)sense;
    if (sense != 0) {
        const Transition *m;
        double force, applied = u;
        if (positive || negative) {
            m = sense > 0 ? &p->right : &p->left;
        } else {
            m = sense > 0 ? &p->coast_right : &p->coast_left;
            applied = 0.0;
        }
        force = sense > 0 ? t->force - p->friction.coulomb_right : t->force + p->friction.coulomb_left;
        t->current = m->i_i * i + m->i_v * v + m->i_u * applied + m->i_f * force;
        t->velocity = m->v_i * i + m->v_v * v + m->v_u * applied + m->v_f * force;
        t->position += m->x_i * i + m->x_v * v + m->x_u * applied + m->x_f * force;
    } else {
        double held = positive || negative ? p->held_i * i + p->held_u * u : 0.0;
        t->current = fabs(held) > 1e-9 ? held : 0.0;
        t->ticks_held++;
    }
    if (((positive && t->current < 0.0) || (negative && t->current > 0.0)) && u_positive != u_negative)
        t->current = 0.0;
    if (t->velocity * sense < 0.0)
        t->velocity = 0.0;
    if (t->position >= p->right_end) {
        t->position = p->right_end;
        t->velocity = t->velocity > 0.0 ? 0.0 : t->velocity;
    } else if (t->position <= p->left_end) {
        t->position = p->left_end;
        t->velocity = t->velocity < 0.0 ? 0.0 : t->velocity;
    }
    double mean_current = 0.5 * (i + t->current), size = fabs(t->current);
    t->voltage = u;
    t->mean_current = mean_current;
    t->energy += u * mean_current * p->period;
    t->peak_current = t->peak_current < size ? size : t->peak_current;
}

/* ---- the tick --------------------------------------------------------------------------------------------------- */

/* What the encoder saw in the last period. */
static inline void sense(const EncoderParams *p, Encoder *e, PrintHeadLines *lines, double start, double x)
{
    unsigned k = 0;
    double pace = x != start ? PERIOD_US / (x - start) : 0.0;
    for (;;) {
        bool rightward = x >= e->next_right;
        double edge = rightward ? e->next_right : e->next_left;
        if (!rightward && x >= edge)
            break;
        pass_edge(p, e, rightward);
        if (k == EDGES)
            k -= 4;
        lines->when_us[k] = (uint8_t)least(most((int64_t)((edge - start) * pace), 0), PERIOD_US - 1);
        lines->levels[k] = (uint8_t)(e->channel_a | e->channel_b << 1);
        k++;
    }
    lines->edges = (uint8_t)k;
}

/* Edges and due columns of the last period, in order of time. */
static inline void take_events(Axis *a, int64_t now)
{
    PrintHeadController *c = &a->r->controller;
    PrintHeadLines *lines = &a->r->lines;
    int64_t begin = now - PERIOD_US;
    unsigned k = 0;
    lines->fired = 0;
    for (;;) {
        int64_t due = c->head.columns.fire_us;
        if (due < now && (k == lines->edges || due <= begin + lines->when_us[k])) {
            fire_column(a->r, due - begin);
            continue;
        }
        if (k == lines->edges)
            return;
        int64_t when = begin + lines->when_us[k];
        int change = count_edge(&c->quadrature, lines->levels[k] & 1u, lines->levels[k] >> 1);
        int64_t cycle = c->quadrature.count >> 2;
        if (cycle != c->cycle) {
            int emitter = cycle > c->cycle ? 1 : -1;
            c->cycle = cycle;
            on_emitter(a, when, emitter);
        }
        if (change == -c->head.direction)
            on_reverse_edge(a);
        k++;
    }
}

/* The computer's turn, and what it puts out. */
static inline void decide(Axis *a, int64_t now)
{
    HeadComputer *h = &a->r->controller.head;
    PrintHeadLines *lines = &a->r->lines;
    if (h->command_latch.flag)
        a->lost = true;
    if (now >= h->wake_us)
        on_timer(a);
    if (h->status.waiting > 0)
        pass_on(&h->status);
    lines->count = (uint16_t)h->out.count;
    lines->right_left = h->out.right_left;
    lines->transition = h->out.transition;
}

static inline void observe(const PrintHeadPlantParams *p, Paper *paper, const PrintHeadLines *lines, double start,
                           double x, double velocity)
{
    const PaperParams *q = &p->paper;
    for (unsigned k = 0; k < lines->fired; k++) {
        int64_t column = lines->place[k] & (COLUMNS - 1);
        double at = start + (x - start) * (lines->fired_us[k] * (1.0 / PERIOD_US));
        double wanted = (double)(q->column_zero + column * q->column_pitch) * q->metres_per_unit;
        paper->offset = at + velocity * q->flight_time - wanted;
        paper->landed[lines->place[k]] = (int32_t)(int64_t)(paper->offset * 1e9);
    }
}

int64_t advance(const PrintHeadParams *p, PrintHead *r, int64_t ticks)
{
    Axis axis = {p, r, false};
    const PrintHeadPlantParams *q = &p->plant;
    PrintHeadPlant *plant = &r->plant;
    DriveTrain train = plant->train; /* only move() writes it: the compiler may keep it in registers */
    double sampled = plant->sampled;
    int64_t tick = r->tick, n = 0;
    if (q->fidelity != 0 || r->controller.head.calibration_pass != 0)
        return NOT_COVERED;
    for (; n < ticks && !r->controller.head.status.latch.flag && !axis.lost; n++, tick++) {
        int64_t now = r->controller.head.now_us += PERIOD_US;
        sense(&q->encoder, &plant->encoder, &r->lines, sampled, train.position);
        take_events(&axis, now);
        decide(&axis, now);
        observe(q, &plant->paper, &r->lines, sampled, train.position, train.velocity);
        sampled = train.position;
        take_over(q, plant, &r->lines);
        train.force = q->push.begin <= tick && tick < q->push.end ? q->push.force : 0.0;
        move(&q->train, &train, plant->bridge.mean_positive, plant->bridge.mean_negative);
    }
    plant->train = train;
    plant->sampled = sampled;
    r->tick = tick;
    return axis.lost ? NOT_COVERED : n;
}
