/* The paper's equation of the angle by the classical Runge-Kutta method, many parameter sets side by side.
 *
 *   theta'' = -xi theta' - alpha (theta - theta_m) - beta (theta - theta_m)^3
 *
 * LANES sets lie in one flat array, so that the compiler puts them side by side in vector registers.
 */

#define LANES 32

/* steps: (n) lengths; drive: (n, 3) motor angle at start, middle, end; parameters: (3, sets); out: (n, sets) angles at
 * the ends of the steps. first, last: blocks of LANES sets. */
void stored(long first, long last, long sets, long n, const double *steps, const double *drive,
            const double *parameters, double *out)
{
    for (long block = first; block < last; block++) {
        double s[2 * LANES] __attribute__((aligned(64))), p[3 * LANES] __attribute__((aligned(64)));
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < LANES; i++)
                p[k * LANES + i] = parameters[k * sets + block * LANES + i];
        for (int i = 0; i < LANES; i++) {
            s[i] = drive[0];
            s[LANES + i] = 0.0;
        }
        for (long m = 0; m < n; m++) {
            const double h = steps[m], half = 0.5 * h, sixth = h / 6.0;
            const double u0 = drive[3 * m], u1 = drive[3 * m + 1], u2 = drive[3 * m + 2];
            for (int i = 0; i < LANES; i++) {
                const double xi = p[i], alpha = p[LANES + i], beta = p[2 * LANES + i], q = s[i], v = s[LANES + i];
                double d = q - u0;
                const double k1 = -xi * v - d * (alpha + beta * d * d), v2 = v + half * k1;
                d = q + half * v - u1;
                const double k2 = -xi * v2 - d * (alpha + beta * d * d), v3 = v + half * k2;
                d = q + half * v2 - u1;
                const double k3 = -xi * v3 - d * (alpha + beta * d * d), v4 = v + h * k3;
                d = q + h * v3 - u2;
                const double k4 = -xi * v4 - d * (alpha + beta * d * d);
                s[i] = q + sixth * (v + 2.0 * v2 + 2.0 * v3 + v4);
                s[LANES + i] = v + sixth * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
            }
            for (int i = 0; i < LANES; i++)
                out[m * sets + block * LANES + i] = s[i];
        }
    }
}

/* The same with nothing stored but the sum of squares of what the angle misses of target: (n) at the ends of the steps. */
void summed(long first, long last, long sets, long n, const double *steps, const double *drive,
            const double *parameters, const double *target, double *sums)
{
    for (long block = first; block < last; block++) {
        double s[3 * LANES] __attribute__((aligned(64))), p[3 * LANES] __attribute__((aligned(64)));
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < LANES; i++)
                p[k * LANES + i] = parameters[k * sets + block * LANES + i];
        for (int i = 0; i < LANES; i++) {
            s[i] = drive[0];
            s[LANES + i] = s[2 * LANES + i] = 0.0;
        }
        for (long m = 0; m < n; m++) {
            const double h = steps[m], half = 0.5 * h, sixth = h / 6.0, goal = target[m];
            const double u0 = drive[3 * m], u1 = drive[3 * m + 1], u2 = drive[3 * m + 2];
            for (int i = 0; i < LANES; i++) {
                const double xi = p[i], alpha = p[LANES + i], beta = p[2 * LANES + i], q = s[i], v = s[LANES + i];
                double d = q - u0;
                const double k1 = -xi * v - d * (alpha + beta * d * d), v2 = v + half * k1;
                d = q + half * v - u1;
                const double k2 = -xi * v2 - d * (alpha + beta * d * d), v3 = v + half * k2;
                d = q + half * v2 - u1;
                const double k3 = -xi * v3 - d * (alpha + beta * d * d), v4 = v + h * k3;
                d = q + h * v3 - u2;
                const double k4 = -xi * v4 - d * (alpha + beta * d * d);
                const double e = q + sixth * (v + 2.0 * v2 + 2.0 * v3 + v4);
                s[i] = e;
                s[LANES + i] = v + sixth * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
                s[2 * LANES + i] += (e - goal) * (e - goal);
            }
        }
        for (int i = 0; i < LANES; i++)
            sums[block * LANES + i] = s[2 * LANES + i];
    }
}
