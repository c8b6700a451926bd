/* A loop in C: the EKF on CTRV with lidar and radar in turn, and its NEES, W runs in the lanes of a vector from the first step to the last.

   The arithmetic is that of trackhelpers.ensemble: CTRV in half angles, products that leave out the zeros of F and H (the compiler drops what it knows to be
   0 or 1), Joseph's form, symmetric matrices by their lower half. A block's state and covariance stay in registers and the first cache for all steps. */

#include <math.h>
#include <string.h>

#define W 8
#define N 5
#define PI 3.14159265358979323846

typedef double v __attribute__((vector_size(W * sizeof(double))));
typedef long long bits __attribute__((vector_size(W * sizeof(long long))));

#define UNROLL _Pragma("GCC unroll 8")
#define INLINE static inline __attribute__((always_inline))

/* A function of the C library for every lane: a loop of its own, for which -ffast-math takes the library's vector version. */
#define LANEWISE(name, function)                                                \
    static __attribute__((noinline)) void name##_lanes(double *restrict a) {    \
        for (int l = 0; l < W; l++) a[l] = function(a[l]);                      \
    }                                                                           \
    INLINE v name(v a) {                                                        \
        name##_lanes((double *)&a);                                             \
        return a;                                                               \
    }
LANEWISE(sine, sin)
LANEWISE(cosine, cos)

static __attribute__((noinline)) void direction_lanes(double *restrict y, const double *restrict x) {
    for (int l = 0; l < W; l++) y[l] = atan2(y[l], x[l]);
}
INLINE v direction(v y, v x) {
    direction_lanes((double *)&y, (const double *)&x);
    return y;
}
INLINE v root(v a) {
    for (int l = 0; l < W; l++) a[l] = sqrt(a[l]);
    return a;
}
INLINE v whole(v a) {
    for (int l = 0; l < W; l++) a[l] = floor(a[l]);
    return a;
}

INLINE v same(double value) { return value - (v){0}; }
INLINE v choose(bits which, v yes, v no) { return (v)((which & (bits)yes) | (~which & (bits)no)); }
INLINE v wrap(v angle) {
    return angle - 2 * PI * whole((angle + PI) * (0.5 / PI));
}

/* F P F' + Q and f(x), at the state before the step */
INLINE void predict(v x[N], v P[N][N], double T, double q_a, double q_w) {
    v h = x[4] * (T / 2), square = h * h, safe = choose(h == 0, same(1), h);
    v sin_h = sine(h), cos_h = cosine(h), s = sine(x[3]), c = cosine(x[3]);
    v j0 = choose(h == 0, same(1), sin_h / safe);
    v series = h / 3 * (1 - square / 10 * (1 - square / 28 * (1 - square / 54 * (1 - square / 88 * (1 - square / 130 * (1 - square / 180))))));
    v j1 = choose(square <= 0.25, series, (j0 - cos_h) / safe);
    v along = c * cos_h - s * sin_h, across = s * cos_h + c * sin_h; /* the direction half a turn step ahead */
    v dx = T * along * j0, dy = T * across * j0;                      /* the step at speed 1 */
    v half = x[2] * (T * T / 2);
    v F[N][N] = {0};
    F[0][2] = dx, F[1][2] = dy;
    F[0][3] = -x[2] * dy, F[1][3] = x[2] * dx;
    F[0][4] = -half * (across * j0 + along * j1), F[1][4] = half * (along * j0 - across * j1);
    F[3][4] = same(T);

    v left[N][N];
    UNROLL for (int i = 0; i < N; i++) UNROLL for (int j = 0; j < N; j++) {
        left[i][j] = P[i][j];
        UNROLL for (int k = 2; k < N; k++) left[i][j] += F[i][k] * P[k][j];
    }
    v G[N][2] = {{c * (T * T / 2)}, {s * (T * T / 2)}, {same(T)}, {(v){0}, same(T * T / 2)}, {(v){0}, same(T)}};
    UNROLL for (int i = 0; i < N; i++) UNROLL for (int j = 0; j <= i; j++) {
        v value = left[i][j] + q_a * G[i][0] * G[j][0] + q_w * G[i][1] * G[j][1];
        UNROLL for (int k = 2; k < N; k++) value += F[j][k] * left[i][k];
        P[i][j] = P[j][i] = value;
    }
    x[0] += x[2] * dx;
    x[1] += x[2] * dy;
    x[3] = wrap(x[3] + T * x[4]);
}

/* the Cholesky factor of A's first n rows, its diagonal inverted */
INLINE void factor(int n, v A[N][N]) {
    UNROLL for (int j = 0; j < n; j++) {
        UNROLL for (int k = 0; k < j; k++) A[j][j] -= A[j][k] * A[j][k];
        A[j][j] = 1 / root(A[j][j]);
        UNROLL for (int i = j + 1; i < n; i++) {
            UNROLL for (int k = 0; k < j; k++) A[i][j] -= A[i][k] * A[j][k];
            A[i][j] *= A[j][j];
        }
    }
}

INLINE void update(int m, v x[N], v P[N][N], v H[3][N], const double *R, v y[3]) {
    v PHt[N][3], S[N][N], K[N][3], B[N][N];
    UNROLL for (int i = 0; i < N; i++) UNROLL for (int k = 0; k < m; k++) {
        PHt[i][k] = (v){0};
        UNROLL for (int j = 0; j < N; j++) PHt[i][k] += P[i][j] * H[k][j];
    }
    UNROLL for (int k = 0; k < m; k++) UNROLL for (int l = 0; l <= k; l++) {
        S[k][l] = same(k == l ? R[k] : 0);
        UNROLL for (int j = 0; j < N; j++) S[k][l] += H[k][j] * PHt[j][l];
    }
    factor(m, S);
    UNROLL for (int i = 0; i < N; i++) {
        UNROLL for (int k = 0; k < m; k++) {
            K[i][k] = PHt[i][k];
            UNROLL for (int l = 0; l < k; l++) K[i][k] -= S[k][l] * K[i][l];
            K[i][k] *= S[k][k];
        }
        UNROLL for (int k = m - 1; k >= 0; k--) {
            UNROLL for (int l = k + 1; l < m; l++) K[i][k] -= S[l][k] * K[i][l];
            K[i][k] *= S[k][k];
        }
    }
    UNROLL for (int i = 0; i < N; i++) UNROLL for (int j = 0; j < N; j++) {
        B[i][j] = P[i][j];
        UNROLL for (int k = 0; k < m; k++) B[i][j] -= K[i][k] * PHt[j][k];
    }
    UNROLL for (int i = 0; i < N; i++) {
        v slack[3];
        UNROLL for (int k = 0; k < m; k++) {
            slack[k] = -R[k] * K[i][k];
            UNROLL for (int j = 0; j < N; j++) slack[k] += B[i][j] * H[k][j];
        }
        UNROLL for (int j = 0; j <= i; j++) {
            v value = B[i][j];
            UNROLL for (int k = 0; k < m; k++) value -= slack[k] * K[j][k];
            P[i][j] = P[j][i] = value;
        }
        UNROLL for (int k = 0; k < m; k++) x[i] += K[i][k] * y[k];
    }
    x[3] = wrap(x[3]);
}

INLINE v nees(v x[N], v P[N][N], const double *truth, long stride) {
    v L[N][N], e[N], sum = {0};
    memcpy(L, P, sizeof L);
    factor(N, L);
    UNROLL for (int i = 0; i < N; i++) e[i] = truth[i * stride] - x[i];
    e[3] = wrap(e[3]);
    UNROLL for (int i = 0; i < N; i++) {
        UNROLL for (int k = 0; k < i; k++) e[i] -= L[i][k] * e[k];
        e[i] *= L[i][i];
        sum += e[i] * e[i];
    }
    return sum;
}

/* x (5, runs) and P (5, 5, runs): the start, then the result. z[k]: the measurements of step k, (3, runs) of the radar at even k, (2, runs) of the lidar at
   odd k. truth (5, steps). sum (steps): NEES summed over the runs whose counts is 1. runs is a multiple of W. */
void ekf_ctrv(long runs, long steps, double T, double q_a, double q_w, const double *R_radar, const double *R_lidar, const double *const *z,
              const double *truth, const double *counts, double *x_all, double *P_all, double *sum) {
    for (long first = 0; first < runs; first += W) {
        v x[N], P[N][N];
        for (int i = 0; i < N; i++) memcpy(&x[i], x_all + i * runs + first, sizeof(v));
        for (int i = 0; i < N * N; i++) memcpy(&P[i / N][i % N], P_all + i * runs + first, sizeof(v));
        for (long step = 0; step < steps; step++) {
            v seen[3];
            predict(x, P, T, q_a, q_w);
            for (int k = 0; k < 3 - step % 2; k++) memcpy(&seen[k], z[step] + k * runs + first, sizeof(v));
            if (step % 2) {
                v H[3][N] = {{same(1)}, {(v){0}, same(1)}};
                v y[3] = {seen[0] - x[0], seen[1] - x[1]};
                update(2, x, P, H, R_lidar, y);
            } else {
                v rho = root(x[0] * x[0] + x[1] * x[1]), c = x[0] / rho, s = x[1] / rho;
                v cos_x = cosine(x[3]), sin_x = sine(x[3]);
                v rate = x[2] * (c * cos_x + s * sin_x), turn = x[2] * (c * sin_x - s * cos_x) / rho;
                v H[3][N] = {{c, s}, {-s / rho, c / rho}, {-s * turn, c * turn, c * cos_x + s * sin_x, -rho * turn}};
                v y[3] = {seen[0] - rho, wrap(seen[1] - direction(x[1], x[0])), seen[2] - rate};
                update(3, x, P, H, R_radar, y);
            }
            v value = nees(x, P, truth + step, steps);
            for (int l = 0; l < W; l++) sum[step] += counts[first + l] * value[l];
        }
        for (int i = 0; i < N; i++) memcpy(x_all + i * runs + first, &x[i], sizeof(v));
        for (int i = 0; i < N * N; i++) memcpy(P_all + i * runs + first, &P[i / N][i % N], sizeof(v));
    }
}
