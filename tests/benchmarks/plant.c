/* The plant of the simulated bench with at most one effect, written by hand in C: what the benchmark compares with.

Same step, same solution of the rim and of what lies in series with a spring; see sim_backend/model/stepper.py.
An effect is compiled in by its name (-DSOFT_WINDUP); what only effects need is left out without one, and what does not
change from step to step is worked out before the loop. layout.h, written by the benchmark, has `struct state`,
`struct inputs` and `struct constants`: doubles in the order of the simulated bench's arrays. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "layout.h"

#define SOLVER static inline __attribute__((always_inline)) /* as in the plant: a tenth faster than calls */

enum mode { OFF, TORQUE, VELOCITY, POSITION };

struct signals {
    double time, motor_position, motor_velocity, motor_torque, motor_current, output_position, output_velocity;
    double temperature, motor_temperature, locked, base_friction;
};

struct reading_errors {
    double motor_position, motor_torque, output_position, output_torque;
};

static inline double clip(double value, double low, double high) {
    return value < low ? low : value > high ? high : value;
}

static inline double play(double value, double before, double radius) {
    return clip(before, value - radius, value + radius);
}

/* tau dx/dt + x = u, exact for a straight u between two calls; `settled` and `late` are worked out once. */
struct lag {
    double value, before, started;
};

struct lag_constants {
    double settled, late;
};

static inline struct lag_constants lag_constants(double time_constant, double step) {
    if (time_constant <= 0.0)
        return (struct lag_constants){1.0, 1.0};
    double settled = -expm1(-step / time_constant);
    return (struct lag_constants){settled, 1.0 - settled * time_constant / step};
}

static inline double follow(struct lag *lag, double value, struct lag_constants k) {
    if (lag->started == 0.0)
        *lag = (struct lag){value, value, 1.0};
    lag->value += k.settled * (lag->before - lag->value) + k.late * (value - lag->before);
    lag->before = value;
    return lag->value;
}

/* ---- the effects: what they remember, their parameters, what is worked out once, and what they add

`struct memory` lies behind the state, for an effect in series twice. */

#define NO_MEMORY struct memory { char nothing; };
#define NOTHING_PREPARED                                                   \
    struct prepared { char nothing; };                                     \
    static inline struct prepared prepare(const struct parameters *p, const struct constants *c) { \
        return (struct prepared){0};                                       \
    }

#if defined KINEMATIC_ERROR
#define ANGLE
NO_MEMORY
struct parameters { double amplitude, order, phase; };
NOTHING_PREPARED
static inline void angle(const struct parameters *p, const struct prepared *k, const struct signals *now,
                         struct memory *m, double *angle, double *slope) {
    double argument = p->order * now->motor_position + p->phase;
    *angle = p->amplitude * sin(argument);
    *slope = p->amplitude * p->order * cos(argument);
}

#elif defined THERMAL_EXPANSION
#define OPEN_ANGLE
struct memory { struct lag lag; };
struct parameters { double amplitude, time_constant, reference; };
struct prepared { struct lag_constants lag; };
static inline struct prepared prepare(const struct parameters *p, const struct constants *c) {
    return (struct prepared){lag_constants(p->time_constant, c->step)};
}
static inline double open_angle(const struct parameters *p, const struct prepared *k, const struct signals *now,
                                struct memory *m) {
    return p->amplitude * (follow(&m->lag, now->temperature, k->lag) - p->reference);
}

#elif defined BACKLASH
#define COUPLED /* in series with the wave generator */
NO_MEMORY
struct parameters { double amplitude, contact, ratio; };
NOTHING_PREPARED
static inline double gap_angle(const struct parameters *p, double torque) {
    return p->amplitude * clip(torque / p->contact, -1.0, 1.0);
}

#elif defined SOFT_WINDUP
#define SERIES
NO_MEMORY
struct parameters { double amplitude, zone; };
NOTHING_PREPARED
static inline double series_angle(const struct parameters *p, const struct prepared *k, const struct signals *now,
                                  double torque, double torsion, struct memory *m) {
    return p->amplitude * tanh(torque / p->zone);
}

#elif defined CREEP
#define SERIES
struct memory { struct lag lag; };
struct parameters { double amplitude, time_constant, stiffness; };
struct prepared { struct lag_constants lag; };
static inline struct prepared prepare(const struct parameters *p, const struct constants *c) {
    return (struct prepared){lag_constants(p->time_constant, c->step)};
}
static inline double series_angle(const struct parameters *p, const struct prepared *k, const struct signals *now,
                                  double torque, double torsion, struct memory *m) {
    return p->amplitude * follow(&m->lag, torque, k->lag) / p->stiffness;
}

#elif defined MAXWELL_SLIP
#define SERIES
struct memory { double play; };
struct parameters { double amplitude, radius; };
NOTHING_PREPARED
static inline double series_angle(const struct parameters *p, const struct prepared *k, const struct signals *now,
                                  double torque, double torsion, struct memory *m) {
    m->play = play(torque, m->play, p->radius);
    return p->amplitude * m->play;
}

#elif defined RATE_DEPENDENT_HYSTERESIS
#define SERIES
struct memory { double value, before, play, started; };
struct parameters { double amplitude, radius, time_constant; };
struct prepared { struct lag_constants lag; };
static inline struct prepared prepare(const struct parameters *p, const struct constants *c) {
    return (struct prepared){lag_constants(p->time_constant, c->step)};
}
static inline double series_angle(const struct parameters *p, const struct prepared *k, const struct signals *now,
                                  double torque, double torsion, struct memory *m) {
    struct lag lag = {m->value, m->before, m->started};
    double value = follow(&lag, torque, k->lag);
    *m = (struct memory){value, torque, play(value, m->play, p->radius), 1.0};
    return p->amplitude * m->play;
}

#elif defined STIFFNESS_MODULATION
#define SERIES
#define SERIES_SLOPE
NO_MEMORY
struct parameters { double amplitude, order, phase; };
NOTHING_PREPARED
static inline double series_angle(const struct parameters *p, const struct prepared *k, const struct signals *now,
                                  double torque, double torsion, struct memory *m) {
    return p->amplitude * torque * sin(p->order * now->motor_position + p->phase);
}
static inline double series_slope(const struct parameters *p, const struct signals *now, double torque) {
    return 0.5 * p->amplitude * p->order * torque * cos(p->order * now->motor_position + p->phase);
}

#elif defined TEMPERATURE_DEPENDENT_STIFFNESS
#define SERIES
NO_MEMORY
struct parameters { double amplitude, reference; };
NOTHING_PREPARED
static inline double series_angle(const struct parameters *p, const struct prepared *k, const struct signals *now,
                                  double torque, double torsion, struct memory *m) {
    return p->amplitude * (now->temperature - p->reference) * torsion;
}

#elif defined FIXTURE_COMPLIANCE
#define SERIES
NO_MEMORY
struct parameters { double amplitude; };
NOTHING_PREPARED
static inline double series_angle(const struct parameters *p, const struct prepared *k, const struct signals *now,
                                  double torque, double torsion, struct memory *m) {
    return p->amplitude * torque * now->locked;
}

#elif defined STRIBECK_FRICTION
#define FRICTION
NO_MEMORY
struct parameters { double amplitude, velocity, exponent; };
NOTHING_PREPARED
static inline double friction(const struct parameters *p, const struct signals *now, double torque) {
    return p->amplitude * exp(-pow(fabs(now->motor_velocity) / p->velocity, p->exponent));
}

#elif defined LOAD_DEPENDENT_FRICTION
#define FRICTION
NO_MEMORY
struct parameters { double amplitude, ratio; };
NOTHING_PREPARED
static inline double friction(const struct parameters *p, const struct signals *now, double torque) {
    return p->amplitude * fabs(torque) / p->ratio;
}

#elif defined POSITION_DEPENDENT_FRICTION
#define FRICTION
NO_MEMORY
struct parameters { double amplitude, order, phase; };
NOTHING_PREPARED
static inline double friction(const struct parameters *p, const struct signals *now, double torque) {
    return p->amplitude * sin(p->order * now->motor_position + p->phase);
}

#elif defined TEMPERATURE_DEPENDENT_FRICTION
#define FRICTION
NO_MEMORY
struct parameters { double amplitude, reference; };
NOTHING_PREPARED
static inline double friction(const struct parameters *p, const struct signals *now, double torque) {
    return now->base_friction * expm1(-p->amplitude * (now->temperature - p->reference));
}

#elif defined COGGING
#define MOTOR_BALANCE
NO_MEMORY
struct parameters { double amplitude, order, phase; };
NOTHING_PREPARED
static inline double motor_balance(const struct parameters *p, const struct signals *now) {
    return p->amplitude * sin(p->order * now->motor_position + p->phase);
}

#elif defined TORQUE_RIPPLE
#define MOTOR_BALANCE
NO_MEMORY
struct parameters { double amplitude, order, phase; };
NOTHING_PREPARED
static inline double motor_balance(const struct parameters *p, const struct signals *now) {
    return p->amplitude * now->motor_torque * sin(p->order * now->motor_position + p->phase);
}

#elif defined GRAVITY_LOAD
#define OUTPUT_BALANCE
NO_MEMORY
struct parameters { double amplitude, phase; };
NOTHING_PREPARED
static inline double output_balance(const struct parameters *p, const struct signals *now) {
    return p->amplitude * sin(now->output_position + p->phase);
}

#elif defined MOTOR_ENCODER_ECCENTRICITY
#define READING motor_position
NO_MEMORY
struct parameters { double amplitude, order, phase; };
NOTHING_PREPARED
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    return p->amplitude * sin(p->order * now->motor_position + p->phase);
}

#elif defined OUTPUT_ENCODER_ECCENTRICITY || defined ENCODER_SUBDIVISION_ERROR
#define READING output_position
NO_MEMORY
struct parameters { double amplitude, order, phase; };
NOTHING_PREPARED
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    return p->amplitude * sin(p->order * now->output_position + p->phase);
}

#elif defined ENCODER_MISSED_COUNTS
#define READING motor_position
struct memory { double events, next, generator, started; };
struct parameters { double amplitude, rate, seed, encoder_counts; };
NOTHING_PREPARED
static inline double draw(double *generator) {
    return *generator = fmod(16807.0 * *generator, 2147483647.0);
}
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    if (m->started == 0.0) {
        m->generator = 1.0 + fmod(floor(p->seed), 2147483646.0);
        for (int i = 0; i < 8; i++)
            draw(&m->generator);
        m->next = now->time;
    }
    while (p->rate > 0.0 && m->next <= now->time) {
        if (m->started != 0.0)
            m->events += draw(&m->generator) < 1073741823.5 ? 1.0 : -1.0;
        m->next -= log(draw(&m->generator) / 2147483647.0) / p->rate;
        m->started = 1.0;
    }
    m->started = 1.0;
    return p->amplitude * m->events * 2.0 * M_PI / p->encoder_counts;
}

#elif defined TORQUE_SENSOR_OFFSET
#define READING output_torque
NO_MEMORY
struct parameters { double amplitude; };
NOTHING_PREPARED
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    return p->amplitude;
}

#elif defined TORQUE_SENSOR_DRIFT
#define READING output_torque
NO_MEMORY
struct parameters { double per_kelvin, per_second, reference; };
NOTHING_PREPARED
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    return p->per_kelvin * (now->temperature - p->reference) + p->per_second * now->time;
}

#elif defined TORQUE_SENSOR_GAIN
#define READING output_torque
NO_MEMORY
struct parameters { double amplitude; };
NOTHING_PREPARED
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    return p->amplitude * torque;
}

#elif defined TORQUE_SENSOR_NONLINEARITY
#define READING output_torque
NO_MEMORY
struct parameters { double even, odd, full_scale; };
NOTHING_PREPARED
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    double x = torque / p->full_scale;
    return (p->even + p->odd * x) * x * x;
}

#elif defined TORQUE_SENSOR_LAG
#define READING output_torque
struct memory { struct lag lag; };
struct parameters { double time_constant; };
struct prepared { struct lag_constants lag; };
static inline struct prepared prepare(const struct parameters *p, const struct constants *c) {
    return (struct prepared){lag_constants(p->time_constant, c->loop_period)};
}
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    return follow(&m->lag, torque, k->lag) - torque;
}

#elif defined CURRENT_SENSOR_OFFSET
#define READING motor_torque
NO_MEMORY
struct parameters { double amplitude, torque_constant; };
NOTHING_PREPARED
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    return p->torque_constant * p->amplitude;
}

#elif defined TORQUE_CONSTANT_ERROR
#define READING motor_torque
NO_MEMORY
struct parameters { double amplitude; };
NOTHING_PREPARED
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    return p->amplitude * now->motor_torque;
}

#elif defined TORQUE_CONSTANT_SATURATION
#define READING motor_torque
NO_MEMORY
struct parameters { double amplitude, torque_constant; };
NOTHING_PREPARED
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    double i = now->motor_current;
    return p->amplitude * p->torque_constant * i * i * i;
}

#elif defined CHANNEL_DELAY
#define READING output_torque
#define PLACES 256
struct memory { double calls, ring[PLACES]; };
struct parameters { double delay; };
struct prepared { double spacing, calls; };
static inline struct prepared prepare(const struct parameters *p, const struct constants *c) {
    return (struct prepared){
        fmax(1.0, ceil(p->delay / (c->loop_period * (PLACES - 2)))), p->delay / c->loop_period};
}
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    if (p->delay <= 0.0)
        return 0.0;
    double turns = m->calls / k->spacing;
    if (turns == floor(turns))
        m->ring[(long)turns % PLACES] = torque;
    double behind = fmax(m->calls - k->calls, 0.0) / k->spacing;
    long left = (long)behind;
    double earlier = m->ring[left % PLACES], later = m->ring[(left + 1) % PLACES];
    m->calls += 1.0;
    return earlier + (later - earlier) * (behind - left) - torque;
}

#elif defined STRUCTURAL_RESONANCE
#define READING output_position
struct memory { double swing, speed, torque, rate, started; };
struct parameters { double amplitude, frequency, damping; };
struct prepared { double w, keep, gain, fall, back; };
static inline struct prepared prepare(const struct parameters *p, const struct constants *c) {
    double w = 2.0 * M_PI * p->frequency, ringing = w * sqrt(1.0 - p->damping * p->damping);
    double decay = exp(-p->damping * w * c->loop_period);
    double cosine = decay * cos(ringing * c->loop_period), sine = decay * sin(ringing * c->loop_period) / ringing;
    return (struct prepared){w, cosine + p->damping * w * sine, sine, cosine - p->damping * w * sine, w * w * sine};
}
static inline double reading(const struct parameters *p, const struct prepared *k, const struct signals *now,
                             double torque, double period, struct memory *m) {
    if (m->started == 0.0) {
        m->torque = torque;
        m->started = 1.0;
    }
    double rate = (torque - m->torque) / period;
    double swing = m->swing, speed = m->speed + k->w * (rate - m->rate);
    m->swing = swing * k->keep + speed * k->gain;
    m->speed = speed * k->fall - swing * k->back;
    m->torque = torque;
    m->rate = rate;
    return p->amplitude * m->swing;
}

#else
NO_MEMORY
struct parameters { double nothing; };
NOTHING_PREPARED
#endif

/* ---- springs and rim */

struct spring {
    double torque, stiffness;
};

static inline struct spring flexspline(double windup, const struct constants *c) {
    if (fabs(windup) < c->flexspline_knee) {
        double tangent = tan(c->C_F * c->K_F0 * windup);
        return (struct spring){tangent / c->C_F, c->K_F0 * (1.0 + tangent * tangent)};
    }
    double torque = c->flexspline_knee_torque + c->flexspline_cap * (fabs(windup) - c->flexspline_knee);
    return (struct spring){copysign(torque, windup), c->flexspline_cap};
}

static inline struct spring wave_generator(double windup, const struct constants *c) {
    double size = fabs(windup);
    if (size < c->wave_generator_knee) {
        double rest = 1.0 - c->C_w * c->K_w0 * size;
        return (struct spring){copysign(-log(rest) / c->C_w, windup), c->K_w0 / rest};
    }
    double torque = c->wave_generator_knee_torque + c->wave_generator_cap * (size - c->wave_generator_knee);
    return (struct spring){copysign(torque, windup), c->wave_generator_cap};
}

static double flexspline_energy(double windup, const struct constants *c) {
    double bent = fmin(fabs(windup), c->flexspline_knee), straight = fabs(windup) - bent;
    double tangent = tan(c->C_F * c->K_F0 * bent);
    double energy = 0.5 * log1p(tangent * tangent) / (c->C_F * c->C_F * c->K_F0);
    return energy + straight * (c->flexspline_knee_torque + 0.5 * c->flexspline_cap * straight);
}

static double wave_generator_energy(double windup, const struct constants *c) {
    double bent = fmin(fabs(windup), c->wave_generator_knee), straight = fabs(windup) - bent;
    double share = c->C_w * c->K_w0 * bent;
    double energy = share < 1e-3
                        ? c->K_w0 * (bent * bent) * (0.5 + share * (1.0 / 6.0 + share * (1.0 / 12.0 + share / 20.0)))
                        : ((1.0 - share) * log1p(-share) + share) / (c->C_w * c->C_w * c->K_w0);
    return energy + straight * (c->wave_generator_knee_torque + 0.5 * c->wave_generator_cap * straight);
}

/* What a spring stored beyond the work of its first and last torque over its travel. */
static inline double missed(double stored, double travel, double first, double last) {
    return stored - 0.5 * (first + last) * travel;
}

#ifdef COUPLED
/* The gap closed on the side that the windup presses, or Newton steps within the contact. */
static inline struct spring coupled(double windup, const struct parameters *p, const struct constants *c) {
    struct spring w = wave_generator(windup - copysign(p->amplitude, windup), c);
    if (w.torque * copysign(1.0, windup) >= p->contact)
        return w;
    double yielding = p->amplitude / p->contact, own = windup / (1.0 + c->K_w0 * yielding);
    for (int trial = 0; trial < 60; trial++) {
        w = wave_generator(own, c);
        double stiffness = w.stiffness / (1.0 + w.stiffness * yielding);
        double residual = own + yielding * w.torque - windup;
        if (fabs(residual) * stiffness <= 1e-12)
            return (struct spring){w.torque, stiffness};
        own -= residual * stiffness / w.stiffness;
    }
    return w;
}
#define WAVE_GENERATOR(windup, e, c) coupled(windup, (e)->p, c)
#else
#define WAVE_GENERATOR(windup, e, c) wave_generator(windup, c)
#endif

/* What lies in series with the flexspline: its own torsion, the torque through it, the angle of the effect. */
struct series {
    double torsion, torque, angle, stiffness, compliance;
};

/* Where the rim is looked for. */
struct ends {
    double rim, base, base_rate, motor_position, motor_velocity, level;
#ifdef SERIES
    const struct signals *now;
    const struct parameters *p;
    const struct prepared *k;
    const struct memory *before;
    struct memory *after;
    struct series series;
#elif defined COUPLED
    const struct parameters *p;
#endif
};

struct rim {
    double slip, rate, T_F, T_w;
};

#ifdef SERIES
/* Wind the series up; gives by how much the torque missed, N*m. */
SOLVER double wind(double windup, double accuracy, struct ends *e, const struct constants *c) {
    struct series *s = &e->series;
    double compliance = s->compliance;
    double torsion = windup - (s->angle + compliance * s->stiffness * (windup - s->torsion - s->angle));
    double low = -INFINITY, high = INFINITY, last_T = 0.0, last_angle = 0.0;
    for (int trial = 0;; trial++) {
        struct spring f = flexspline(torsion, c);
        *e->after = *e->before;
        double angle = series_angle(e->p, e->k, e->now, f.torque, torsion, e->after);
        if (trial > 0 && fabs(f.torque - last_T) > 1e-9)
            compliance = (angle - last_angle) / (f.torque - last_T);
        last_T = f.torque;
        last_angle = angle;
        double stiffness = f.stiffness / fmax(1.0 + compliance * f.stiffness, 0.1);
        double residual = torsion + angle - windup, correction = residual * stiffness;
        if (fabs(correction) <= accuracy) {
            torsion -= correction / f.stiffness;
            *s = (struct series){torsion, f.torque - correction, windup - torsion, stiffness, compliance};
            return fabs(correction);
        }
        if (residual > 0.0)
            high = torsion;
        else
            low = torsion;
        double following = torsion - correction / f.stiffness;
        if (!(low < following && following < high))
            following = 0.5 * (low + high);
        if (following == torsion || trial == 59) {
            *s = (struct series){following, f.torque, angle, stiffness, compliance};
            return 0.0;
        }
        torsion = following;
    }
}
#endif

/* Newton steps inside a bracket for the slip at which dry friction in `direction` balances both springs. */
SOLVER struct rim slide(double direction, double guess, double rate_weight, double rate_offset,
                               struct ends *e, const struct constants *c) {
    struct rim r = {.slip = guess};
    double low = -INFINITY, high = INFINITY;
#ifdef SERIES
    double accuracy = 1e-4;
#endif
    for (int trial = 0; trial < 100; trial++) {
        r.rate = rate_weight * r.slip - rate_offset;
#ifdef SERIES
        double miss = wind(e->base - e->rim - r.slip, accuracy, e, c);
        struct spring f = {e->series.torque, e->series.stiffness};
#else
        struct spring f = flexspline(e->base - e->rim - r.slip, c);
#endif
        struct spring w = WAVE_GENERATOR(-e->motor_position - c->ratio * (e->rim + r.slip), e, c);
        r.T_F = f.torque + c->flexspline_damping * (e->base_rate - r.rate);
        r.T_w = w.torque - c->wave_generator_damping * (e->motor_velocity + c->ratio * r.rate);
        double residual = r.T_F + c->ratio * r.T_w - c->rim_damping * r.rate - direction * e->level;
        double fall_F = f.stiffness + c->flexspline_damping * rate_weight;
        double fall_w = c->ratio * (w.stiffness + c->wave_generator_damping * rate_weight);
        double correction = residual / (fall_F + c->ratio * fall_w + c->rim_damping * rate_weight);
#ifdef SERIES
        if (fabs(residual) <= c->near && miss > 1e-6) {
            r.slip += correction;
            accuracy = 1e-6;
            continue;
        }
        if (fabs(residual) <= c->near) {
            struct series *s = &e->series;
            double fall = s->stiffness * correction, give = s->compliance * fall;
            s->torsion -= correction - give;
            s->torque -= fall;
            s->angle -= give;
#else
        if (fabs(residual) <= c->near) {
#endif
            return (struct rim){r.slip + correction, r.rate + rate_weight * correction, r.T_F - fall_F * correction,
                                r.T_w - fall_w * correction};
        }
        if (residual > 0.0)
            low = r.slip;
        else
            high = r.slip;
        double following = r.slip + correction;
        if (!(low < following && following < high))
            following = 0.5 * (low + high);
        if (following == r.slip)
            break;
        r.slip = following;
    }
    return r;
}

SOLVER struct rim move_rim(double last_slip, struct ends *e, const struct constants *c) {
#ifdef SERIES
    struct series last = e->series;
#endif
    if (last_slip != 0.0) {
        double direction = copysign(1.0, last_slip);
        struct rim r = slide(direction, last_slip, 1.5 / c->step, 0.5 * last_slip / c->step, e, c);
        if (r.slip * direction > 0.0 && r.rate * direction >= 0.0)
            return r;
    }
#ifdef SERIES
    e->series = last;
    wind(e->base - e->rim, 1e-6, e, c);
    double T_F = e->series.torque + c->flexspline_damping * e->base_rate;
#else
    double T_F = flexspline(e->base - e->rim, c).torque + c->flexspline_damping * e->base_rate;
#endif
    double T_w = WAVE_GENERATOR(-e->motor_position - c->ratio * e->rim, e, c).torque;
    T_w -= c->wave_generator_damping * e->motor_velocity;
    double force = T_F + c->ratio * T_w;
    if (fabs(force) <= e->level)
        return (struct rim){0.0, 0.0, T_F, T_w};
    return slide(copysign(1.0, force), 0.0, 1.0 / c->step, 0.0, e, c);
}

/* ---- drive loops, heat and the step */

static bool drive_loop(double mode, double target, double limit, double position, double velocity, double position_gain,
                       double velocity_gain, double integral_gain, double speed_limit, double period, double *torque,
                       double *integral) {
    if (mode == OFF) {
        *torque = *integral = 0.0;
        return false;
    }
    if (mode == TORQUE) {
        *torque = *integral = clip(target, -limit, limit);
        return *torque != target;
    }
    if (mode == POSITION)
        target = clip(position_gain * (target - position), -speed_limit, speed_limit);
    double error = target - velocity, wanted = velocity_gain * error + *integral;
    *torque = clip(wanted, -limit, limit);
    if (*torque == wanted || (wanted - *torque) * error < 0.0)
        *integral = clip(*integral + integral_gain * period * error, -limit, limit);
    return *torque != wanted;
}

static void run_drive_loops(struct state *s, const struct inputs *in, const struct constants *c) {
    if (drive_loop(in->motor_mode, in->motor_target, in->motor_limit, s->motor_position + s->motor_position_error,
                   s->motor_velocity + s->motor_velocity_error, c->motor_position_gain, c->motor_velocity_gain,
                   c->motor_integral_gain, c->motor_speed_limit, c->loop_period, &s->motor_command, &s->motor_integral))
        s->motor_limited = 1.0;
    if (in->motor_mode == OFF)
        s->motor_command = s->motor_torque_error;
    if (drive_loop(in->load_mode, in->load_target, in->load_limit, s->output_position, s->output_velocity,
                   c->load_position_gain, c->load_velocity_gain, c->load_integral_gain, c->load_speed_limit,
                   c->loop_period, &s->load_command, &s->load_integral))
        s->load_limited = 1.0;
}

static void warm_up(struct state *s, double current, const struct constants *c) {
    double friction_power = (s->dissipated - s->heat_before) / c->loop_period;
    s->heat_before = s->dissipated;
    double gear_end = c->ambient_temperature + c->gear_thermal_resistance * friction_power;
    s->gear_temperature += c->gear_settling * (gear_end - s->gear_temperature);
    double winding_end =
        c->ambient_temperature + c->motor_thermal_resistance * c->winding_resistance * current * current;
    s->winding_temperature += c->motor_settling * (winding_end - s->winding_temperature);
}

#define STEEP 1500.0 /* 1/s: rate of a spring's torque, times largest d(ln K)/dT, beyond which a step is bent */

static inline double brake(double velocity, double loss) {
    return loss == 0.0 ? velocity : copysign(fmax(fabs(velocity) - loss, 0.0), velocity);
}

/* Take the energy that is owed out of both bodies: their speeds change by one factor. */
static inline void pay(struct state *s, const struct constants *c) {
    double kinetic = 0.5 * (c->motor_inertia * s->motor_velocity * s->motor_velocity +
                            c->output_inertia * s->output_velocity * s->output_velocity);
    double share = fabs(s->owed) < 0.5 * kinetic ? sqrt(1.0 - s->owed / kinetic) : 1.0;
    if (share == 1.0)
        return;
    s->motor_velocity *= share;
    s->output_velocity *= share;
    s->owed = 0.0;
}

static inline struct signals signals_at(double time, double motor_velocity, double output_velocity,
                                        const struct state *s, const struct inputs *in, const struct constants *c) {
    return (struct signals){
        .time = time,
        .motor_position = s->motor_position,
        .motor_velocity = motor_velocity,
        .motor_torque = s->motor_torque,
        .motor_current = s->shown_torque / c->torque_constant,
        .output_position = s->output_position,
        .output_velocity = output_velocity,
        .temperature = s->gear_temperature,
        .motor_temperature = s->winding_temperature,
        .locked = in->locked,
        .base_friction = c->running_friction + c->running_viscous_friction * fabs(motor_velocity),
    };
}

void advance(int64_t steps, struct state *state, const struct inputs *in, const struct constants *c,
             const struct parameters *p) {
    struct state now = *state, *s = &now;
    struct memory *kept = (struct memory *)(state + 1), memory = *kept;
#ifdef SERIES
    struct memory trial;
#endif
#ifdef COUPLED
    double base = 0.0;
#endif
    const struct prepared k = prepare(p, c);
    const double h = c->step, half_m = 0.5 * h / c->motor_inertia, half_o = 0.5 * h / c->output_inertia;
    const double rotor_loss = half_m * c->rotor_friction;
    double torsion = s->output_position - s->error - s->rim, wound = s->motor_position + c->ratio * s->rim;
#ifdef SERIES
    torsion -= s->series_angle;
#endif
#ifdef COUPLED
    wound += s->coupling_angle;
#endif

    for (int64_t i = 1; i <= steps; i++) {
        if (s->loop_wait <= 0.0) {
            s->loop_wait = c->loop_steps;
            warm_up(s, in->motor_mode == OFF ? 0.0 : s->shown_torque / c->torque_constant, c);
            run_drive_loops(s, in, c);
        }
        s->loop_wait -= 1.0;
        double motor_lag = s->shown_torque - s->motor_command, load_lag = s->load_torque - s->load_command;
        double motor_drive = s->motor_command + motor_lag * c->current_mean - s->motor_torque_error;
        double load_drive = s->load_command + load_lag * c->current_mean;
        s->shown_torque = s->motor_command + motor_lag * c->current_decay;
        s->load_torque = s->load_command + load_lag * c->current_decay;
        s->motor_torque = s->shown_torque - s->motor_torque_error;

        double last_m = s->motor_velocity, last_o = s->output_velocity;
        double middle_m = brake(last_m + half_m * (motor_drive + s->motor_force), rotor_loss);
        double middle_o = last_o + half_o * (load_drive + s->fixture_torque + s->output_force);
        double next_m = 2.0 * middle_m - last_m, next_o = 2.0 * middle_o - last_o;
        double motor_travel = h * middle_m, output_travel = h * middle_o;
        s->motor_position += motor_travel;
        s->output_position += output_travel;
        s->fixture_torque = -in->locked * (c->fixture_stiffness * (s->output_position - in->lock_position) +
                                           c->fixture_damping * next_o);
        double time = (s->steps + i) * h;
        struct signals signals = signals_at(time, next_m, next_o, s, in, c);

        double level = c->friction_torque;
#ifdef FRICTION
        level += c->ratio * friction(p, &signals, 2.0 * s->t_f_now - s->t_f_before);
        level = fmax(level, -c->rim_damping * fabs(s->slip) / h);
#endif
        double slope = 0.0, last_error = s->error;
#if defined ANGLE
        angle(p, &k, &signals, &memory, &s->error, &slope);
#elif defined OPEN_ANGLE
        s->error = open_angle(p, &k, &signals, &memory);
#endif
        struct ends ends = {
            .rim = s->rim,
            .base = s->output_position - s->error,
            .base_rate = next_o - slope * next_m,
            .motor_position = s->motor_position,
            .motor_velocity = next_m,
            .level = level,
#ifdef SERIES
            .now = &signals, .p = p, .k = &k, .before = &memory, .after = &trial,
            .series = {s->series_torsion, s->series_torque, s->series_angle, s->series_stiffness,
                       s->series_compliance},
#elif defined COUPLED
            .p = p,
#endif
        };
        struct rim rim = move_rim(s->slip, &ends, c);
        s->rim += rim.slip;
        s->slip = rim.slip;
        s->t_f_before = s->t_f_now;
        s->t_f_now = rim.T_F;
        double last_elastic = s->t_w_now + s->wave_generator_damper;
        s->t_w_now = rim.T_w;
        double damper_F = c->flexspline_damping * (ends.base_rate - rim.rate);
        double damper_w = c->wave_generator_damping * (next_m + c->ratio * rim.rate);
        double elastic = rim.T_w + damper_w, gap = 0.0;
#ifdef COUPLED
        gap = gap_angle(p, elastic);
#endif
        double now_torsion = ends.base - s->rim, now_wound = s->motor_position + c->ratio * s->rim + gap;
#ifdef SERIES
        now_torsion -= ends.series.angle;
#endif
        if (fabs(elastic - last_elastic) * c->C_w > STEEP * h ||
            fabs(s->t_f_now - s->t_f_before) * c->flexspline_stiffening > STEEP * h) {
            double stored = flexspline_energy(now_torsion, c) - flexspline_energy(torsion, c);
            s->owed += missed(stored, now_torsion - torsion, s->t_f_before - s->flexspline_damper, rim.T_F - damper_F);
            stored = wave_generator_energy(now_wound, c) - wave_generator_energy(wound, c);
            s->owed += missed(stored, now_wound - wound, -last_elastic, -elastic);
        }
        torsion = now_torsion;
        wound = now_wound;
        double pull = 0.0;
#ifdef SERIES
        memory = trial;
        s->effect_work += 0.5 * (ends.series.torque + s->series_torque) * (ends.series.angle - s->series_angle);
        s->series_torsion = ends.series.torsion;
        s->series_torque = ends.series.torque;
        s->series_angle = ends.series.angle;
        s->series_stiffness = ends.series.stiffness;
        s->series_compliance = ends.series.compliance;
#endif
#ifdef SERIES_SLOPE
        pull = s->series_torque * series_slope(p, &signals, s->series_torque);
        s->effect_work -= 0.5 * (pull + s->pull) * motor_travel;
        s->pull = pull;
#endif
#ifdef OPEN_ANGLE
        s->effect_work += 0.5 * (s->t_f_now + s->t_f_before) * (s->error - s->error_open);
        s->error_open = s->error;
#endif
        double motor_extra = 0.0, output_extra = 0.0;
#ifdef MOTOR_BALANCE
        motor_extra = motor_balance(p, &signals);
        s->effect_work += 0.5 * (motor_extra + s->motor_effects) * motor_travel;
        s->motor_effects = motor_extra;
#endif
#ifdef OUTPUT_BALANCE
        output_extra = output_balance(p, &signals);
        s->effect_work += 0.5 * (output_extra + s->output_effects) * output_travel;
        s->output_effects = output_extra;
#endif
        s->motor_force = rim.T_w + rim.T_F * slope + pull - motor_extra - c->rotor_viscous_friction * next_m;
        s->output_force = -rim.T_F - output_extra - c->output_viscous_friction * next_o;
        s->motor_velocity = brake(middle_m + half_m * (motor_drive + s->motor_force), rotor_loss);
        s->output_velocity = middle_o + half_o * (load_drive + s->fixture_torque + s->output_force);

        double rim_force = rim.T_F + c->ratio * rim.T_w;
        if (rim.slip != 0.0)
            rim_force = copysign(level, rim.slip) + c->rim_damping * rim.rate;
        double damper_m = c->rotor_viscous_friction * next_m, damper_o = c->output_viscous_friction * next_o;
        double damper_l = in->locked * c->fixture_damping * next_o;
#ifdef COUPLED
        s->effect_work += 0.5 * (elastic + last_elastic) * (gap - s->coupling_angle);
        s->coupling_angle = gap;
        base = ends.base;
#endif
        s->work += 0.5 * h *
                   (motor_drive * (last_m + s->motor_velocity) + load_drive * (last_o + s->output_velocity));
        s->dissipated += 0.5 * ((s->rim_force + rim_force) * rim.slip +
                                (s->flexspline_damper + damper_F) * (output_travel - (s->error - last_error) - rim.slip) +
                                (s->wave_generator_damper + damper_w) * (motor_travel + c->ratio * rim.slip) +
                                (s->motor_damper + damper_m) * motor_travel +
                                (s->output_damper + damper_o + s->fixture_damper + damper_l) * output_travel +
                                c->rotor_friction * h * fabs(last_m + s->motor_velocity));
        s->rim_force = rim_force;
        s->flexspline_damper = damper_F;
        s->wave_generator_damper = damper_w;
        s->motor_damper = damper_m;
        s->output_damper = damper_o;
        s->fixture_damper = damper_l;
        if (s->owed != 0.0)
            pay(s, c);
#ifdef READING
        if (s->loop_wait <= 0.0) {
            struct signals end = signals_at(time, s->motor_velocity, s->output_velocity, s, in, c);
            struct reading_errors errors = {0};
            double torque = s->load_torque + s->fixture_torque;
            errors.READING = reading(p, &k, &end, torque, c->loop_period, &memory);
            s->motor_velocity_error = (errors.motor_position - s->motor_position_error) / c->loop_period;
            s->output_velocity_error = (errors.output_position - s->output_position_error) / c->loop_period;
            s->motor_position_error = errors.motor_position;
            s->motor_torque_error = errors.motor_torque;
            s->output_position_error = errors.output_position;
            s->output_torque_error = errors.output_torque;
            s->motor_torque = s->shown_torque - s->motor_torque_error;
        }
#endif
    }
#ifdef COUPLED
    struct spring f = flexspline(base - s->rim, c); /* the simulated bench keeps its own torsion here */
    s->series_torsion = base - s->rim;
    s->series_torque = f.torque;
    s->series_stiffness = f.stiffness;
#endif
    s->steps += steps;
    s->output_torque = s->load_torque + s->fixture_torque;
    *kept = memory;
    *state = now;
}
