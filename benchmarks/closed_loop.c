/* The closed loop of swingid.simulate as a plain scalar C program, to measure the compiled kernel against.
 *
 *     closed_loop INPUT OUTPUT REPEATS
 *
 * INPUT (doubles): rows, rate (1/s), limit, resolution, 27 parameters of swingid.model.parameters, 17 of
 * swingid.control.law for relative degree 2, then the reference, one number per row. OUTPUT (doubles): angle,
 * wheel angle, voltage, adaptive gain of every row. Prints the least time of one run in seconds.
 * The same equations, modes, integrator, error control and event location; perfect timing, quantised encoders.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { A11, A12, A22, B, DIRECT, GEAR, C1, C2, ETA, D1, D2, F2, F3, WHEEL_STATIC, AXIS_STICKS,
       VISCOUS_P, VISCOUS_N, COULOMB_P, COULOMB_N, STATIC_P, STATIC_N, STRIBECK_SPEED, QUADRATIC, CUBIC,
       OFFSET, SIGMA0, SIGMA1, SIZE };
enum { ORDER, SAMPLE_TIME, DELTA0, LAMBDA0, SIGMA_0, K_MAX, ERROR_DECAY, WHEEL_DECAY, PLANT_SIGN,
       DIFFERENTIATE, LIMIT, COULOMB, DEAD_NEGATIVE, DEAD_POSITIVE, BACK_EMF, ALPHA1, ALPHA0, K1, GAINS };
enum { Q1, V1, Q2, V2, Z, N };

typedef struct { int s1, s2, branch; } Mode;
typedef struct { double k[7][N], trial[N], new[N]; } Work;

static const double RESOLUTION = 1e-14, ROUNDING = 1e-9, LONGEST = 1e-3, SHORTEST = 1e-12, GUARD = 1e-6;

/* Friction and motor. */

static double dry_level(double v, int s, const double *p) {
    double coulomb = s > 0 ? p[COULOMB_P] : p[COULOMB_N], fs = s > 0 ? p[STATIC_P] : p[STATIC_N];
    if (fs == coulomb || p[STRIBECK_SPEED] == 0.0) return coulomb;
    double x = v / p[STRIBECK_SPEED];
    return coulomb + (fs - coulomb) * exp(-x * x);
}

static double wet_friction(double v, int s, const double *p) {
    double viscous = s > 0 ? p[VISCOUS_P] : p[VISCOUS_N];
    return v * (viscous + v * (s * p[QUADRATIC] + v * p[CUBIC])) + p[OFFSET];
}

static double bristle_rate(double v, int s, double z, const double *p) {
    if (p[SIGMA0] == 0.0) return 0.0;
    return v - p[SIGMA0] * s * v * z / dry_level(v, s, p);
}

static double sliding_friction(double v, int s, double z, const double *p) {
    if (p[SIGMA0] == 0.0) return s * dry_level(v, s, p) + wet_friction(v, s, p);
    return p[SIGMA0] * z + p[SIGMA1] * bristle_rate(v, s, z, p) + wet_friction(v, s, p);
}

static double release_margin(double hold, const double *p) {
    double dry = hold - p[OFFSET];
    return fmin(p[STATIC_P] - dry, p[STATIC_N] + dry);
}

static double ideal_torque(double u, double v2, const double *p) { return p[ETA] * (p[C1] * u - p[C2] * v2); }

static int motor_branch(double u, double v2, const double *p) {
    if (p[D1] == 0.0 && p[D2] == 0.0) return 1;
    double torque = ideal_torque(u, v2, p);
    return torque > p[D1] ? 1 : torque < p[D2] ? -1 : 0;
}

static double branch_margin(double u, double v2, int branch, const double *p) {
    if (p[D1] == 0.0 && p[D2] == 0.0) return INFINITY;
    double torque = ideal_torque(u, v2, p);
    if (branch > 0) return torque - p[D1];
    if (branch < 0) return p[D2] - torque;
    return fmin(p[D1] - torque, torque - p[D2]);
}

static double branch_torque(double u, double v2, int branch, const double *p) {
    if (branch > 0) return ideal_torque(u, v2, p) - p[D1];
    if (branch < 0) return ideal_torque(u, v2, p) - p[D2];
    return 0.0;
}

/* Equations of motion. */

static double axis_load(double q1, double u, const double *p) { return p[DIRECT] * u - p[B] * sin(q1); }

static double wheel_load(double u, double v2, int s2, int branch, const double *p) {
    return p[GEAR] * (branch_torque(u, v2, branch, p) - (p[F2] * p[GEAR] * v2 + p[F3] * s2));
}

static void accelerations(const double *y, Mode m, double u, const double *p, double *a1, double *a2) {
    *a1 = *a2 = 0.0;
    if (m.s1 != 0 && m.s2 != 0) {
        double r1 = axis_load(y[Q1], u, p) - sliding_friction(y[V1], m.s1, y[Z], p);
        double r2 = wheel_load(u, y[V2], m.s2, m.branch, p);
        double determinant = p[A11] * p[A22] - p[A12] * p[A12];
        *a1 = (p[A22] * r1 - p[A12] * r2) / determinant;
        *a2 = (p[A11] * r2 - p[A12] * r1) / determinant;
    } else if (m.s1 != 0) {
        *a1 = (axis_load(y[Q1], u, p) - sliding_friction(y[V1], m.s1, y[Z], p)) / p[A11];
    } else if (m.s2 != 0) {
        *a2 = wheel_load(u, y[V2], m.s2, m.branch, p) / p[A22];
    }
}

static void derivative(const double *y, Mode m, double u, const double *p, double *out) {
    double a1, a2;
    accelerations(y, m, u, p, &a1, &a2);
    out[Q1] = y[V1]; out[V1] = a1; out[Q2] = y[V2]; out[V2] = a2;
    out[Z] = bristle_rate(y[V1], m.s1, y[Z], p);
}

static void holding_torques(const double *y, double a1, double a2, Mode m, double u, const double *p,
                            double *hold1, double *hold2) {
    *hold1 = axis_load(y[Q1], u, p) - p[A12] * a2;
    *hold2 = wheel_load(u, y[V2], m.s2, m.branch, p) - p[A12] * a1;
}

/* Dormand and Prince 5(4). */

static double step(const double *y, double h, Mode m, double u, const double *p, Work *w) {
    double(*k)[N] = w->k, *trial = w->trial, *new = w->new, worst = 0.0;
    for (int i = 0; i < N; i++) trial[i] = y[i] + h * (1.0 / 5) * k[0][i];
    derivative(trial, m, u, p, k[1]);
    for (int i = 0; i < N; i++) trial[i] = y[i] + h * (3.0 / 40 * k[0][i] + 9.0 / 40 * k[1][i]);
    derivative(trial, m, u, p, k[2]);
    for (int i = 0; i < N; i++)
        trial[i] = y[i] + h * (44.0 / 45 * k[0][i] - 56.0 / 15 * k[1][i] + 32.0 / 9 * k[2][i]);
    derivative(trial, m, u, p, k[3]);
    for (int i = 0; i < N; i++) {
        double slope = 19372.0 / 6561 * k[0][i] - 25360.0 / 2187 * k[1][i] + 64448.0 / 6561 * k[2][i]
                       - 212.0 / 729 * k[3][i];
        trial[i] = y[i] + h * slope;
    }
    derivative(trial, m, u, p, k[4]);
    for (int i = 0; i < N; i++) {
        double slope = 9017.0 / 3168 * k[0][i] - 355.0 / 33 * k[1][i] + 46732.0 / 5247 * k[2][i]
                       + 49.0 / 176 * k[3][i];
        trial[i] = y[i] + h * (slope - 5103.0 / 18656 * k[4][i]);
    }
    derivative(trial, m, u, p, k[5]);
    for (int i = 0; i < N; i++) {
        double slope = 35.0 / 384 * k[0][i] + 500.0 / 1113 * k[2][i] + 125.0 / 192 * k[3][i]
                       - 2187.0 / 6784 * k[4][i];
        new[i] = y[i] + h * (slope + 11.0 / 84 * k[5][i]);
    }
    derivative(new, m, u, p, k[6]);
    for (int i = 0; i < N; i++) {
        double error = 71.0 / 57600 * k[0][i] - 71.0 / 16695 * k[2][i] + 71.0 / 1920 * k[3][i]
                       - 17253.0 / 339200 * k[4][i];
        error = fabs(h * (error + 22.0 / 525 * k[5][i] - 1.0 / 40 * k[6][i]));
        double allowed = i == V1 || i == V2 ? 1e-9 : 1e-11;
        if (i == Z) {
            if (p[SIGMA0] == 0.0) break;
            allowed = 1e-8 * fmax(p[COULOMB_P], p[COULOMB_N]) / p[SIGMA0];
        }
        worst = fmax(worst, error / (allowed + 1e-13 * fabs(y[i])));
    }
    return worst;
}

static double quintic(double x, double h, double q, double v, double a, double qh, double vh, double ah) {
    double d0 = qh - (q + h * (v + 0.5 * h * a)), d1 = h * (vh - (v + h * a)), d2 = h * h * (ah - a);
    double c3 = 10.0 * d0 - 4.0 * d1 + 0.5 * d2, c4 = -15.0 * d0 + 7.0 * d1 - d2;
    double c5 = 6.0 * d0 - 3.0 * d1 + 0.5 * d2;
    return q + h * x * (v + 0.5 * h * x * a) + x * x * x * (c3 + x * (c4 + x * c5));
}

static double quintic_speed(double x, double h, double q, double v, double a, double qh, double vh, double ah) {
    double d0 = qh - (q + h * (v + 0.5 * h * a)), d1 = h * (vh - (v + h * a)), d2 = h * h * (ah - a);
    double c3 = 10.0 * d0 - 4.0 * d1 + 0.5 * d2, c4 = -15.0 * d0 + 7.0 * d1 - d2;
    double c5 = 6.0 * d0 - 3.0 * d1 + 0.5 * d2;
    return v + h * x * a + x * x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)) / h;
}

/* Rest and sliding. */

static double margin(const double *y, const double *slope, Mode m, double u, const double *p) {
    double least = branch_margin(u, y[V2], m.branch, p), hold1, hold2;
    if (m.s1 != 0) least = fmin(least, m.s1 * y[V1]);
    if (m.s2 != 0) least = fmin(least, m.s2 * y[V2]);
    if (m.s1 == 0 || m.s2 == 0) {
        holding_torques(y, slope[V1], slope[V2], m, u, p, &hold1, &hold2);
        if (m.s1 == 0) least = fmin(least, release_margin(hold1, p));
        if (m.s2 == 0) least = fmin(least, p[WHEEL_STATIC] - fabs(hold2));
    }
    return least;
}

static int agrees(const double *y, Mode m, double u, const double *p) {
    double a1, a2, hold1, hold2;
    accelerations(y, m, u, p, &a1, &a2);
    holding_torques(y, a1, a2, m, u, p, &hold1, &hold2);
    if (y[V1] == 0.0) {
        if (m.s1 == 0 && (p[AXIS_STICKS] == 0.0 || release_margin(hold1, p) < 0.0)) return 0;
        if (m.s1 != 0 && m.s1 * a1 < -ROUNDING) return 0;
    }
    if (y[V2] == 0.0) {
        if (m.s2 == 0 && (p[WHEEL_STATIC] == 0.0 || p[WHEEL_STATIC] - fabs(hold2) < 0.0)) return 0;
        if (m.s2 != 0 && m.s2 * a2 < -ROUNDING) return 0;
    }
    return 1;
}

static Mode choose_mode(const double *y, double u, const double *p) {
    int side1 = (y[V1] > 0.0) - (y[V1] < 0.0), side2 = (y[V2] > 0.0) - (y[V2] < 0.0);
    Mode m = {side1, side2, motor_branch(u, y[V2], p)};
    if (side1 != 0 && side2 != 0) return m;
    for (int i = 0; i < (side1 == 0 ? 3 : 1); i++)
        for (int j = 0; j < (side2 == 0 && p[WHEEL_STATIC] < INFINITY ? 3 : 1); j++) {
            Mode tried = {side1 ? side1 : i < 2 ? i : -1, side2 ? side2 : j < 2 ? j : -1, m.branch};
            if (agrees(y, tried, u, p)) return tried;
        }
    double hold1, hold2;
    holding_torques(y, 0.0, 0.0, m, u, p, &hold1, &hold2);
    if (side1 == 0 && (p[AXIS_STICKS] == 0.0 || release_margin(hold1, p) < 0.0)) m.s1 = hold1 > 0.0 ? 1 : -1;
    if (side2 == 0 && p[WHEEL_STATIC] - fabs(hold2) < 0.0) m.s2 = hold2 > 0.0 ? 1 : -1;
    return m;
}

static double dip(double v, double a, double vh, double ah, double h) {
    if (a >= 0.0 || ah <= 0.0) return h;
    double c2 = (3.0 * (vh - v) / h - 2.0 * a - ah) / h, c3 = (2.0 * (v - vh) / h + a + ah) / (h * h);
    double low = -a / (c2 + sqrt(fmax(c2 * c2 - 3.0 * c3 * a, 0.0)));
    return 0.0 < low && low < h && v + low * (a + low * (c2 + low * c3)) < 0.0 ? low : h;
}

static double first_dip(const double *y, double h, Mode m, const Work *w) {
    const double *k = w->k[0], *kh = w->k[6], *new = w->new;
    double low = h;
    if (m.s1 != 0) low = fmin(low, dip(m.s1 * y[V1], m.s1 * k[V1], m.s1 * new[V1], m.s1 * kh[V1], h));
    if (m.s2 != 0) low = fmin(low, dip(m.s2 * y[V2], m.s2 * k[V2], m.s2 * new[V2], m.s2 * kh[V2], h));
    return low;
}

static double locate(const double *y, double h, Mode m, double u, const double *p, Work *w) {
    double low = 0.0, high = h, at_low = margin(y, w->k[0], m, u, p), at_high = margin(w->new, w->k[6], m, u, p);
    int last = 0;
    for (int trial = 0; trial < 200 && high - low > RESOLUTION; trial++) {
        double middle = 0.5 * (low + high);
        if (at_low > 0.0 && trial % 4 != 3) {
            middle = (low * at_high - high * at_low) / (at_high - at_low);
            middle = fmin(fmax(middle, low + 0.25 * RESOLUTION), high - 0.25 * RESOLUTION);
        }
        step(y, middle, m, u, p, w);
        double at_middle = margin(w->new, w->k[6], m, u, p);
        if (at_middle < 0.0) {
            high = middle; at_high = at_middle;
            if (last > 0) at_low *= 0.5;
            last = 1;
        } else {
            low = middle; at_low = at_middle;
            if (last < 0) at_high *= 0.5;
            last = -1;
        }
    }
    step(y, high, m, u, p, w);
    return high;
}

/* Motion under a held command. */

typedef struct { double longest, *seen; int next, count; const double *instants; } Run;

static void fill_probes(double t, double h, double until, const double *y, const Work *w, Run *r) {
    const double *k = w->k[0], *kh = w->k[6], *new = w->new;
    for (; r->next < r->count && r->instants[r->next] <= until; r->next++) {
        double x = (r->instants[r->next] - t) / h, *seen = r->seen + N * r->next;
        seen[Q1] = quintic(x, h, y[Q1], y[V1], k[V1], new[Q1], new[V1], kh[V1]);
        seen[V1] = quintic_speed(x, h, y[Q1], y[V1], k[V1], new[Q1], new[V1], kh[V1]);
        seen[Q2] = quintic(x, h, y[Q2], y[V2], k[V2], new[Q2], new[V2], kh[V2]);
        seen[V2] = quintic_speed(x, h, y[Q2], y[V2], k[V2], new[Q2], new[V2], kh[V2]);
        double rise = new[Z] - y[Z], start = h * k[Z] - rise, end = rise - h * kh[Z];
        seen[Z] = y[Z] + x * (rise + (1.0 - x) * ((1.0 - x) * start + x * end));
    }
}

static double try_step(double t, double t_end, double u, const double *y, Mode m, const double *p, Work *w, Run *r) {
    double left = t_end - t, h = left <= r->longest * (1.0 + 1e-6) ? left : r->longest;
    for (;;) {
        double error = step(y, h, m, u, p, w);
        double factor = error > 0.0 ? fmin(5.0, fmax(0.2, 0.9 * pow(error, -0.2))) : 5.0;
        if (error <= 1.0 || h <= SHORTEST) {
            double next = h < left || factor < 1.0 ? h * factor : fmax(h * factor, r->longest);
            r->longest = fmin(next, LONGEST);
            return h;
        }
        h *= fmin(factor, 0.9);
    }
}

static void advance(double t, double t_end, double u, double *y, const double *p, Work *w, Run *r) {
    Mode m = choose_mode(y, u, p);
    int events = 0;
    derivative(y, m, u, p, w->k[0]);
    while (t < t_end) {
        double h = try_step(t, t_end, u, y, m, p, w, r);
        int ended = margin(w->new, w->k[6], m, u, p) < 0.0;
        if (!ended) {
            double low = first_dip(y, h, m, w);
            if (low < h) {
                step(y, low, m, u, p, w);
                ended = margin(w->new, w->k[6], m, u, p) < 0.0;
                h = low;
            }
        }
        if (ended) {
            double least = events >= 64 ? fmin(h, GUARD) : 0.0;
            h = locate(y, h, m, u, p, w);
            if (h < least) step(y, h = least, m, u, p, w);
        }
        double until = !ended && h >= t_end - t ? t_end : t + h;
        fill_probes(t, h, until, y, w, r);
        t = until;
        memcpy(y, w->new, sizeof w->new);
        if (ended) {
            events++;
            if (m.s1 * y[V1] < 0.0) y[V1] = 0.0;
            if (m.s2 * y[V2] < 0.0) y[V2] = 0.0;
            m = choose_mode(y, u, p);
            derivative(y, m, u, p, w->k[0]);
        } else {
            memcpy(w->k[0], w->k[6], sizeof w->k[0]);
        }
    }
}

/* The consecutive compensator (14)-(20), relative degree 2. */

static double compensator(double reference, double angle, double wheel, double *s, const double *g) {
    double h = g[SAMPLE_TIME], e = reference - angle, k = s[0], next = k;
    double filtered = g[ERROR_DECAY] > 0.0 ? s[1] : e;
    if (fabs(filtered) > g[DELTA0]) next = fmax(k, fmin(k + g[LAMBDA0] * h, g[K_MAX]));
    double slope = (next - k) / h, rate = g[SIGMA_0] * k * k * g[K1] * (e - s[4]);
    double gain = g[DIFFERENTIATE] != 0.0 ? slope * s[4] : 0.0;
    double u = g[PLANT_SIGN] * (g[ALPHA1] * (gain + k * rate) + g[ALPHA0] * k * s[4]);
    if (s[3] == 0.0) { s[3] = 1.0; s[2] = wheel; }
    double change = (wheel - s[2]) * (1.0 - g[WHEEL_DECAY]);
    s[2] += change;
    double speed = change / h;
    u += g[COULOMB] * ((speed > 0.0) - (speed < 0.0));
    double side = u - g[BACK_EMF] * speed;
    if (side > 0.0) u += g[DEAD_POSITIVE];
    else if (side < 0.0) u += g[DEAD_NEGATIVE];
    s[4] = e + (s[4] - e) * exp(-g[K1] * g[SIGMA_0] * h * (k * k + k * next + next * next) / 3.0);
    s[1] = e + (s[1] - e) * g[ERROR_DECAY];
    s[0] = next;
    return fmin(fmax(u, -g[LIMIT]), g[LIMIT]);
}

static double reading(double q, double resolution) { return resolution > 0.0 ? resolution * rint(q / resolution) : q; }

static void closed_loop(int rows, double limit, double resolution, const double *p, const double *g,
                        const double *times, const double *reference, double *seen, double *log) {
    double y[N] = {0.0}, s[5] = {0.0, 0.0, 0.0, 1.0, 0.0};
    Work w;
    Run r = {LONGEST, seen, 0, rows, times};
    memset(&w, 0, sizeof w);
    for (int k = 0; k < rows; k++) {
        double angle = reading(y[Q1], resolution), wheel = reading(y[Q2], resolution);
        double u = fmin(fmax(compensator(reference[k], angle, wheel, s, g), -limit), limit);
        log[4 * k + 2] = u;
        log[4 * k + 3] = s[0];
        advance(times[k], times[k + 1], u, y, p, &w, &r);
    }
    for (int k = 0; k < rows; k++) {
        log[4 * k] = reading(seen[N * k + Q1], resolution);
        log[4 * k + 1] = reading(seen[N * k + Q2], resolution);
    }
}

int main(int argc, char **argv) {
    double head[4 + SIZE + GAINS], best = INFINITY;
    FILE *file = argc == 4 ? fopen(argv[1], "rb") : NULL;
    if (!file || fread(head, sizeof(double), 4 + SIZE + GAINS, file) != 4 + SIZE + GAINS) return 2;
    int rows = (int)head[0], repeats = atoi(argv[3]);
    double *reference = malloc(sizeof(double) * rows), *times = malloc(sizeof(double) * (rows + 1));
    double *log = calloc(4 * (size_t)rows, sizeof(double)), *seen = calloc(N * (size_t)rows, sizeof(double));
    if (fread(reference, sizeof(double), rows, file) != (size_t)rows) return 2;
    fclose(file);
    for (int k = 0; k <= rows; k++) times[k] = k / head[1];
    for (int i = 0; i < repeats; i++) {
        struct timespec a, b;
        clock_gettime(CLOCK_MONOTONIC, &a);
        closed_loop(rows, head[2], head[3], head + 4, head + 4 + SIZE, times, reference, seen, log);
        clock_gettime(CLOCK_MONOTONIC, &b);
        best = fmin(best, (b.tv_sec - a.tv_sec) + 1e-9 * (b.tv_nsec - a.tv_nsec));
    }
    file = fopen(argv[2], "wb");
    if (!file || fwrite(log, sizeof(double), 4 * (size_t)rows, file) != 4 * (size_t)rows) return 2;
    fclose(file);
    printf("%.9f\n", best);
    return 0;
}
