/* The step by hand: what the controller's own steps are measured against.
 *
 * Run-time rule, literal rule, step timer and phases of one motor, in the same order, so that both end on the same
 * registers; everything that changes lives in local copies, which the compiler keeps in machine registers. The
 * rows of a trace are not covered. step_rule_registers.h, the declarations of
 * the structures, is generated from the register files.
 */
#include <stdbool.h>
#include <stdint.h>

#include "step_rule_registers.h"

enum { REST, ACCEL, CRUISE, DECEL, TURN, FAULT };
enum { IDLE, STEP, PAUSE };
enum { INFEASIBLE = 1, OUT_OF_RANGE = 2 };
enum { AT_REST = -1 };

/* Tables of both directions by the position that a step departs from. */
typedef struct {
    const int16_t *up, *down;
    int64_t length;
} Tables;

static inline int32_t slower(bool reload, int32_t one, int32_t other)
{
    return reload == (one > other) ? one : other;
}

static inline int32_t entry_word(const StepRuleParams *p, int32_t entry)
{
    return slower(p->reload, p->ramp[entry & p->index_mask], p->limit[entry >> p->zone_shift]);
}

static inline int compare_words(bool reload, int32_t present, int32_t permissible)
{
    if (present == permissible)
        return 0;
    bool faster = reload && present && permissible ? present < permissible : present > permissible;
    return faster ? 1 : -1;
}

static inline void follow(StepRule *r, int32_t permissible, int32_t goal)
{
    if (r->index == goal) {
        r->relation = 0;
        r->state = CRUISE;
    } else if (r->index < goal) {
        r->index++;
        r->relation = -1;
        r->state = ACCEL;
    } else {
        r->index--;
        r->relation = 1;
        if (r->state != FAULT) {
            r->state = DECEL;
            if (r->index > permissible) {
                r->state = FAULT;
                r->cause = INFEASIBLE;
            }
        }
    }
}

static inline void follow_literally(const StepRuleParams *p, StepRule *r, int32_t entry, int32_t goal)
{
    r->relation = (int8_t)compare_words(p->reload, r->word, entry < 0 ? 0 : entry_word(p, entry));
    r->state = r->relation == 0 ? CRUISE : r->relation < 0 ? ACCEL : DECEL;
    r->index = (int16_t)goal;
}

static inline int32_t wanted_index(const StepRule *r, int32_t permissible)
{
    if (r->state == FAULT || r->heading != r->direction)
        return AT_REST;
    if (r->manual)
        return permissible < r->request ? permissible : r->request;
    return r->active ? permissible : AT_REST;
}

static inline bool asked_to_run(const StepRule *r)
{
    return r->active || (r->manual && r->request >= 0);
}

static inline bool take_inputs(StepRule *r, int64_t positions)
{
    if (r->reset) {
        r->reset = r->start = 0;
        if (r->index < 0)
            r->state = REST;
    }
    if (r->manual)
        r->start = r->active = 0;
    if (r->start && r->state != FAULT) {
        r->start = 0;
        r->active = 1;
    }
    if (r->index >= 0)
        return true;
    if (r->state == FAULT || !asked_to_run(r))
        return false;
    r->direction = r->heading;
    if (r->position < 0 || r->position >= positions) {
        r->state = FAULT;
        r->cause = OUT_OF_RANGE;
        r->active = 0;
        r->event = 1;
        return false;
    }
    return true;
}

static int come_to_rest(StepRule *r, int32_t permissible, bool moved)
{
    r->word = 0;
    if (r->active && permissible < 0 && r->turns > 0) {
        r->turns--;
        r->heading = (int8_t)-r->direction;
    }
    if (r->state != FAULT && r->heading != r->direction && asked_to_run(r)) {
        r->direction = r->heading;
        r->state = TURN;
        return PAUSE;
    }
    if (moved || r->active)
        r->event = 1;
    r->active = 0;
    if (r->state != FAULT)
        r->state = REST;
    return IDLE;
}

static inline int next_step(const StepRuleParams *p, StepRule *r, const Tables *t)
{
    if (!take_inputs(r, t->length))
        return IDLE;
    int32_t entry = AT_REST;
    if (r->state != FAULT)
        entry = (r->direction > 0 ? t->up : t->down)[r->position];
    int32_t permissible = entry >= 0 ? entry & p->index_mask : AT_REST, goal = wanted_index(r, permissible);
    bool moved = r->index >= 0;
    if (p->literal)
        follow_literally(p, r, entry, goal);
    else
        follow(r, permissible, goal);
    if (r->index < 0)
        return come_to_rest(r, permissible, moved);
    r->word = p->ramp[r->index];
    if (entry >= 0)
        r->word = slower(p->reload, r->word, p->limit[entry >> p->zone_shift]);
    if (r->manual && r->index == r->request)
        r->word = slower(p->reload, r->word, r->request_word);
    r->position += r->direction;
    return STEP;
}

static inline void load_period(const StepTimerParams *p, StepTimer *r, int32_t word)
{
    r->period = p->reload ? word : (p->clock_hz + word - 1) / word;
    r->expires += r->period;
}

static inline void pause_motor(const StepperControllerParams *p, StepTimer *timer)
{
    int64_t start = timer->expires;
    if (p->pause)
        load_period(&p->timer, timer, p->rule.ramp[0]);
    timer->expires = start + p->pause * timer->period;
}

int64_t advance(const StepperControllerParams *restrict p, StepperController *restrict r, const int16_t *restrict up,
                const int16_t *restrict down, int64_t length, int64_t steps)
{
    const Tables tables = {up, down, length};
    StepRule rule = r->rule;
    StepTimer timer = r->timer;
    int64_t done = 0;
    while (done < steps && rule.event == 0) {
        int outcome = next_step(&p->rule, &rule, &tables);
        if (outcome == STEP) {
            load_period(&p->timer, &timer, rule.word);
            timer.phase = (timer.phase + rule.direction) & 3;
            timer.pulses++;
            if (rule.position == r->stop_at)
                rule.event = 1;
            done++;
        } else if (outcome == PAUSE) {
            pause_motor(p, &timer);
        } else {
            timer.period = 0;
            break;
        }
    }
    r->rule = rule;
    r->timer = timer;
    return done;
}
