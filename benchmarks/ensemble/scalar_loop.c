/* The closed loop of the paper as a lean scalar C program, to measure the ensemble's kernel against.
 *
 *     scalar_loop INPUT OUTPUT REPEATS CHANNELS
 *
 * INPUT (doubles): rows, rate (1/s), limit, resolution, 27 parameters of swingid.model.parameters, 17 of
 * swingid.control.law for relative degree 2, then the reference, one number per row. OUTPUT (doubles, CHANNELS per row,
 * 0 to 3): angle, wheel angle, voltage; with 0 channels the last state alone. Prints the least time of one run in seconds.
 *
 * The classical Runge-Kutta step, one per sample; sign and dead zone at every stage by branches, nothing located. So it
 * does less than the twin: it is right within a sample of each kink only, and takes Stribeck's peak, narrower than that,
 * in one step too. Viscous, Coulomb, Stribeck and quadratic friction.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { A11, A12, A22, B, DIRECT, GEAR, C1, C2, ETA, D1, D2, F2, F3, WHEEL_STATIC, AXIS_STICKS,
       VISCOUS_P, VISCOUS_N, COULOMB_P, COULOMB_N, STATIC_P, STATIC_N, STRIBECK_SPEED, QUADRATIC, CUBIC,
       OFFSET, SIGMA0, SIGMA1, SIZE };
enum { ORDER, SAMPLE_TIME, DELTA0, LAMBDA0, SIGMA_0, K_MAX, ERROR_DECAY, WHEEL_DECAY, PLANT_SIGN,
       DIFFERENTIATE, LIMIT, COULOMB, DEAD_NEGATIVE, DEAD_POSITIVE, BACK_EMF, ALPHA1, ALPHA0, K1, GAINS };

typedef struct { double q1, v1, q2, v2; } State;
typedef struct { double k, filtered, memory, seen, xi; } Controller;

static inline double sign(double x) { return (x > 0.0) - (x < 0.0); }

static inline State slope(State y, double u, const double *restrict p, double m11, double m12, double m22) {
    double torque = p[ETA] * (p[C1] * u - p[C2] * y.v2);
    double motor = torque > p[D1] ? torque - p[D1] : torque < p[D2] ? torque - p[D2] : 0.0;
    double r2 = p[GEAR] * (motor - p[F2] * p[GEAR] * y.v2 - p[F3] * sign(y.v2));
    double side = sign(y.v1), viscous = y.v1 > 0.0 ? p[VISCOUS_P] : p[VISCOUS_N];
    double coulomb = y.v1 > 0.0 ? p[COULOMB_P] : p[COULOMB_N];
    if (p[STRIBECK_SPEED] > 0.0) {
        double ratio = y.v1 / p[STRIBECK_SPEED];
        coulomb += ((y.v1 > 0.0 ? p[STATIC_P] : p[STATIC_N]) - coulomb) * exp(-ratio * ratio);
    }
    double r1 = -p[B] * sin(y.q1) - viscous * y.v1 - side * (coulomb + p[QUADRATIC] * y.v1 * y.v1);
    return (State){y.v1, m11 * r1 - m12 * r2, y.v2, m22 * r2 - m12 * r1};
}

static inline State ahead(State y, double h, State k) {
    return (State){y.q1 + h * k.q1, y.v1 + h * k.v1, y.q2 + h * k.q2, y.v2 + h * k.v2};
}

static inline double control(double reference, double angle, double wheel, Controller *restrict s, const double *restrict g) {
    double h = g[SAMPLE_TIME], e = reference - angle, k = s->k, next = k;
    double filtered = g[ERROR_DECAY] > 0.0 ? s->filtered : e;
    if (fabs(filtered) > g[DELTA0]) next = fmax(k, fmin(k + g[LAMBDA0] * h, g[K_MAX]));
    double rate = g[SIGMA_0] * k * k * g[K1] * (e - s->xi);
    double gain = g[DIFFERENTIATE] != 0.0 ? (next - k) / h * s->xi : 0.0;
    double u = g[PLANT_SIGN] * (g[ALPHA1] * (gain + k * rate) + g[ALPHA0] * k * s->xi);
    if (s->seen == 0.0) { s->seen = 1.0; s->memory = wheel; }
    double change = (wheel - s->memory) * (1.0 - g[WHEEL_DECAY]);
    s->memory += change;
    double speed = change / h;
    u += g[COULOMB] * sign(speed);
    double side = u - g[BACK_EMF] * speed;
    if (side > 0.0) u += g[DEAD_POSITIVE];
    else if (side < 0.0) u += g[DEAD_NEGATIVE];
    s->xi = e + (s->xi - e) * exp(-g[K1] * g[SIGMA_0] * h * (k * k + k * next + next * next) / 3.0);
    s->filtered = e + (s->filtered - e) * g[ERROR_DECAY];
    s->k = next;
    return fmin(fmax(u, -g[LIMIT]), g[LIMIT]);
}

static inline double reading(double q, double resolution) {
    return resolution > 0.0 ? resolution * rint(q / resolution) : q;
}

static State closed_loop(int rows, double h, double limit, double resolution, const double *restrict p,
                         const double *restrict g, const double *restrict reference, int channels, double *restrict log) {
    State y = {0.0, 0.0, 0.0, 0.0};
    Controller s = {0.0, 0.0, 0.0, 0.0, 0.0};
    double determinant = p[A11] * p[A22] - p[A12] * p[A12];
    double m11 = p[A22] / determinant, m12 = p[A12] / determinant, m22 = p[A11] / determinant;
    for (int k = 0; k < rows; k++) {
        double angle = reading(y.q1, resolution), wheel = reading(y.q2, resolution);
        double u = fmin(fmax(control(reference[k], angle, wheel, &s, g), -limit), limit);
        if (channels == 3) {
            log[3 * k] = angle;
            log[3 * k + 1] = wheel;
            log[3 * k + 2] = u;
        }
        State a = slope(y, u, p, m11, m12, m22);
        State b = slope(ahead(y, 0.5 * h, a), u, p, m11, m12, m22);
        State c = slope(ahead(y, 0.5 * h, b), u, p, m11, m12, m22);
        State d = slope(ahead(y, h, c), u, p, m11, m12, m22);
        y.q1 += h / 6.0 * (a.q1 + 2.0 * (b.q1 + c.q1) + d.q1);
        y.v1 += h / 6.0 * (a.v1 + 2.0 * (b.v1 + c.v1) + d.v1);
        y.q2 += h / 6.0 * (a.q2 + 2.0 * (b.q2 + c.q2) + d.q2);
        y.v2 += h / 6.0 * (a.v2 + 2.0 * (b.v2 + c.v2) + d.v2);
    }
    return y;
}

int main(int argc, char **argv) {
    double head[4 + SIZE + GAINS], best = INFINITY;
    FILE *file = argc == 5 ? fopen(argv[1], "rb") : NULL;
    if (!file || fread(head, sizeof(double), 4 + SIZE + GAINS, file) != 4 + SIZE + GAINS) return 2;
    int rows = (int)head[0], repeats = atoi(argv[3]), channels = atoi(argv[4]);
    double *reference = malloc(sizeof(double) * rows), *log = calloc(3 * (size_t)rows, sizeof(double));
    if (fread(reference, sizeof(double), rows, file) != (size_t)rows) return 2;
    fclose(file);
    State end = {0.0, 0.0, 0.0, 0.0};
    for (int i = 0; i < repeats; i++) {
        struct timespec a, b;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &a);
        end = closed_loop(rows, 1.0 / head[1], head[2], head[3], head + 4, head + 4 + SIZE, reference, channels, log);
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &b);
        best = fmin(best, (b.tv_sec - a.tv_sec) + 1e-9 * (b.tv_nsec - a.tv_nsec));
    }
    file = fopen(argv[2], "wb");
    if (channels == 3) fwrite(log, sizeof(double), 3 * (size_t)rows, file);
    else fwrite(&end, sizeof(end), 1, file);
    fclose(file);
    printf("%.9f\n", best);
    return 0;
}
