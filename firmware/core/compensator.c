#include "compensator.h"

#define TAYLOR_TERMS 14
#define MOST_SQUARINGS 64

typedef char needs_doubles_of_64_bits[sizeof(double) == 8 ? 1 : -1];

/* What the chain of filters is computed in, see compensator.h. */
#ifdef SWINGID_SINGLE
typedef float real;
#else
typedef double real;
#endif

typedef real matrix[SWINGID_MOST_ORDER][SWINGID_MOST_ORDER];

static const real half = (real)0.5;
static const real log2e = (real)1.4426950408889634;
static const real ln2_high = (real)6.93147180369123816490e-01;
static const real ln2_low = (real)1.90821492927058770002e-10;

static real size_of(real x) { return x < 0 ? -x : x; }

/* exp(-x) for x >= 0. */
static real decay(real x) {
    static const real series[] = {1.0 / 2,     1.0 / 6,      1.0 / 24,      1.0 / 120,      1.0 / 720,       1.0 / 5040,
                                  1.0 / 40320, 1.0 / 362880, 1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600,
                                  1.0 / 6227020800};
    int place = sizeof series / sizeof series[0] - 1, n;
    real r, p;
    if (!(x > 0)) return 1;
    if (x > 708) return 0;
    n = (int)(x * log2e + half);
    r = (n * ln2_high - x) + n * ln2_low;
    for (p = series[place]; place > 0;) p = series[--place] + r * p;
    p = 1 + (r + r * r * p);
    for (; n > 0; n--) p *= half;
    return p;
}

double swingid_decay(double x) { return decay((real)x); }

/* c = factor a b, of n rows and columns; c is neither a nor b. */
static void multiply(matrix c, matrix a, matrix b, real factor, int n) {
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            c[i][j] = 0;
            for (int m = 0; m < n; m++) c[i][j] += factor * a[i][m] * b[m][j];
        }
    }
}

static void copy(matrix to, matrix from, int n) {
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) to[i][j] = from[i][j];
    }
}

/* Exponential of a small stable matrix, by scaling and squaring of a Taylor polynomial. */
static void exponential(matrix result, matrix a, int n) {
    matrix product;
    real size = 0, scale = 1;
    int squarings = 0;
    for (int i = 0; i < n; i++) {
        real row = 0;
        for (int j = 0; j < n; j++) row += size_of(a[i][j]);
        if (row > size) size = row;
    }
    while (size > half && squarings < MOST_SQUARINGS) {
        size *= half;
        scale *= half;
        squarings++;
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) result[i][j] = i == j ? 1 : 0;
    }
    for (int term = TAYLOR_TERMS; term > 0; term--) {
        multiply(product, a, result, scale / term, n);
        copy(result, product, n);
        for (int i = 0; i < n; i++) result[i][i] += 1;
    }
    for (; squarings > 0; squarings--) {
        multiply(product, result, result, 1, n);
        copy(result, product, n);
    }
}

/* The chain (16) over one sample, the error e held; turn is the integral of sigma. */
static void held_chain(real e, real *xi, real turn, const real *k, int n) {
    matrix companion, move;
    real distance[SWINGID_MOST_ORDER];
    if (n == 0) return;
    if (n == 1) {
        xi[0] = e + (xi[0] - e) * decay(k[0] * turn);
        return;
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) companion[i][j] = 0;
    }
    for (int i = 0; i < n - 1; i++) companion[i][i + 1] = turn;
    for (int i = 0; i < n; i++) companion[n - 1][i] = -k[i] * turn;
    exponential(move, companion, n);
    for (int i = 0; i < n; i++) distance[i] = xi[i];
    distance[0] -= e;
    for (int i = 0; i < n; i++) {
        xi[i] = 0;
        for (int j = 0; j < n; j++) xi[i] += move[i][j] * distance[j];
    }
    xi[0] += e;
}

/* alpha(p)(k xi_1) of (20), or k alpha(p) xi_1 of (15), at the start of a sample. */
static real chain_output(real e, const real *xi, real k_tilde, real slope, real sigma0, const real *alpha,
                         const real *k, int n, int differentiate_gain) {
    real series[SWINGID_MOST_ORDER][SWINGID_MOST_ORDER + 1];
    real sigma[3], output = 0, factorial = 1;
    if (n == 0) return alpha[0] * k_tilde * e;
    if (n == 1) {
        real rate = sigma0 * k_tilde * k_tilde * k[0] * (e - xi[0]);
        real gain_term = differentiate_gain ? slope * xi[0] : 0;
        return alpha[0] * (gain_term + k_tilde * rate) + alpha[1] * k_tilde * xi[0];
    }
    sigma[0] = sigma0 * k_tilde * k_tilde;
    sigma[1] = 2 * sigma0 * k_tilde * slope;
    sigma[2] = sigma0 * slope * slope;
    for (int j = 0; j < n; j++) {
        series[j][0] = xi[j];
        for (int i = 1; i <= n; i++) series[j][i] = 0;
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            for (int m = 0; m <= (i < 2 ? i : 2); m++) {
                real drive;
                if (j < n - 1) {
                    drive = series[j + 1][i - m];
                } else {
                    drive = i == m ? k[0] * e : 0;
                    for (int col = 0; col < n; col++) drive -= k[col] * series[col][i - m];
                }
                series[j][i + 1] += sigma[m] * drive / (i + 1);
            }
        }
    }
    for (int power = 0; power <= n; power++) {
        real value = k_tilde * series[0][power];
        if (power > 1) factorial *= power;
        if (differentiate_gain && power > 0) value += slope * series[0][power - 1];
        output += alpha[n - power] * factorial * value;
    }
    return output;
}

/* Wheel speed (rad/s) from sampled angles; the first sample has no past and gives 0. */
static double wheel_speed(double wheel_angle, double *state, const double *p) {
    double change;
    if (state[SWINGID_WHEEL_SEEN] == 0.0) {
        state[SWINGID_WHEEL_SEEN] = 1.0;
        state[SWINGID_WHEEL_MEMORY] = wheel_angle;
    }
    change = (wheel_angle - state[SWINGID_WHEEL_MEMORY]) * (1.0 - p[SWINGID_WHEEL_DECAY]);
    state[SWINGID_WHEEL_MEMORY] += change;
    return change / p[SWINGID_SAMPLE_TIME];
}

/* u0 = u1 + u2 + u3 (V), to which a motor with Coulomb friction and dead zone answers as a linear one. */
static double motor_compensation(double u2, double speed, const double *p) {
    double direction = speed > 0.0 ? 1.0 : speed < 0.0 ? -1.0 : speed; /* 0 keeps its sign, as in numba */
    double u = u2 + p[SWINGID_COULOMB] * direction;
    double change = u - p[SWINGID_BACK_EMF] * speed;
    if (change > 0.0) return u + p[SWINGID_DEAD_POSITIVE];
    if (change < 0.0) return u + p[SWINGID_DEAD_NEGATIVE];
    return u;
}

double swingid_compensator_step(double reference, double angle, double wheel_angle, double *state, const double *p) {
    const int order = (int)p[SWINGID_ORDER];
    const double h = p[SWINGID_SAMPLE_TIME], limit = p[SWINGID_LIMIT];
    real alpha[SWINGID_MOST_ORDER + 1], k[SWINGID_MOST_ORDER], xi[SWINGID_MOST_ORDER];
    const double e = reference - angle;
    const double filtered = p[SWINGID_ERROR_DECAY] > 0.0 ? state[SWINGID_FILTERED_ERROR] : e;
    const double k_tilde = state[SWINGID_K_TILDE];
    double k_next = k_tilde, slope, output, u2, speed, u0, turn;

    if ((filtered < 0.0 ? -filtered : filtered) > p[SWINGID_DELTA0]) {
        double grown = k_tilde + p[SWINGID_LAMBDA0] * h;
        if (p[SWINGID_K_TILDE_MAX] < grown) grown = p[SWINGID_K_TILDE_MAX];
        if (grown > k_tilde) k_next = grown;
    }
    slope = (k_next - k_tilde) / h;

    for (int i = 0; i <= order; i++) alpha[i] = (real)p[SWINGID_ALPHA + i];
    for (int i = 0; i < order; i++) {
        k[i] = (real)p[SWINGID_ALPHA + order + 1 + i];
        xi[i] = (real)state[SWINGID_XI + i];
    }
    output = chain_output((real)e, xi, (real)k_tilde, (real)slope, (real)p[SWINGID_SIGMA0], alpha, k, order,
                          p[SWINGID_DIFFERENTIATE_GAIN] != 0.0);
    u2 = p[SWINGID_PLANT_SIGN] * output;
    speed = wheel_speed(wheel_angle, state, p);
    u0 = motor_compensation(u2, speed, p);

    /* k tilde is linear over the sample, so this is the exact integral of sigma = sigma0 k^2 (19). */
    turn = p[SWINGID_SIGMA0] * h * (k_tilde * k_tilde + k_tilde * k_next + k_next * k_next) / 3.0;
    held_chain((real)e, xi, (real)turn, k, order);
    for (int i = 0; i < order; i++) state[SWINGID_XI + i] = xi[i];
    state[SWINGID_FILTERED_ERROR] = e + (state[SWINGID_FILTERED_ERROR] - e) * p[SWINGID_ERROR_DECAY];
    state[SWINGID_K_TILDE] = k_next;
    if (u0 < -limit) return -limit;
    return u0 > limit ? limit : u0;
}
