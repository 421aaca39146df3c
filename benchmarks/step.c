/* The loop a C programmer would write: causal-3 body increments and a step of frame n.
 *
 * The arithmetic of navgrade/reconstruction/causal.py and navgrade/mechanization/ned.py (free
 * vertical channel, equal intervals, heights inside the gravity fit), in one pass, every state
 * stored. `benchmarks/c_loop.py` compiles it and compares.
 */
#include <math.h>

typedef struct { double x, y, z; } vec;
typedef struct { double w, x, y, z; } quat;

typedef struct {
    double a, e2, omega;     /* m, -, rad/s */
    double down[15], north[6]; /* gravity fit */
} world;

typedef struct { vec acceleration, rate, per_metre; } place;
typedef struct { double lat, sine, cosine; } anchor;

static const double WEIGHTS[4][3] = {
    {0.0, 0.0, 0.0},
    {1.0 / 12, 0.0, 0.0},
    {7.0 / 60, -1.0 / 60, 0.0},
    {113.0 / 840, -26.0 / 840, 3.0 / 840},
};

static const double REACH = 1e-3; /* rad */

static inline vec cross(vec a, vec b)
{
    return (vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static inline vec load(const double *p) { return (vec){p[0], p[1], p[2]}; }

static inline void add_scaled(vec *sum, double c, const double *p)
{
    sum->x += c * p[0];
    sum->y += c * p[1];
    sum->z += c * p[2];
}

static inline quat product(quat p, quat q)
{
    return (quat){
        p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z,
        p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y,
        p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
        p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w,
    };
}

static inline vec rotate(quat q, vec v)
{
    vec u = {q.x, q.y, q.z};
    vec t = cross(u, v), s = cross(u, t);
    return (vec){
        v.x + 2.0 * (q.w * t.x + s.x),
        v.y + 2.0 * (q.w * t.y + s.y),
        v.z + 2.0 * (q.w * t.z + s.z),
    };
}

static inline quat change_of(vec phi)
{
    double x2 = phi.x * phi.x + phi.y * phi.y + phi.z * phi.z, y = 0.25 * x2, w, s;
    if (x2 < 1e-8) {
        w = -0.5 * y;
        s = 0.5 - y * (1.0 / 12.0);
    } else {
        int halvings = 0;
        for (; 0.03 <= 4.0 * y && 4.0 * y < INFINITY; halvings++)
            y *= 0.25;
        w = -y * (0.5 - y * (1.0 / 24.0 - y * (1.0 / 720.0 - y * (1.0 / 40320.0))));
        s = 0.5 - y * (1.0 / 12.0 - y * (1.0 / 240.0 - y * (1.0 / 10080.0 - y * (1.0 / 725760.0))));
        for (; halvings; halvings--) {
            s *= 1.0 + w;
            w *= 2.0 * (2.0 + w);
        }
    }
    return (quat){w, s * phi.x, s * phi.y, s * phi.z};
}

static inline void rotation_factors(double x2, double *a, double *b)
{
    if (x2 < 0.03) {
        *a = 0.5 - x2 * (1.0 / 24.0 - x2 * (1.0 / 720.0 - x2 * (1.0 / 40320.0
             - x2 * (1.0 / 3628800.0 - x2 * (1.0 / 479001600.0)))));
        *b = 1.0 / 6.0 - x2 * (1.0 / 120.0 - x2 * (1.0 / 5040.0
             - x2 * (1.0 / 362880.0 - x2 * (1.0 / 39916800.0))));
    } else {
        double x = sqrt(x2), s = sin(0.5 * x);
        *a = 2.0 * s * s / x2;
        *b = (1.0 - sin(x) / x) / x2;
    }
}

static inline void body(long k, const double *dt, const double *dtheta, const double *dvel,
                        vec *phi, vec *dv, vec *dr)
{
    long p = k < 3 ? k : 3;
    const double *c = WEIGHTS[p];
    vec A = {0}, B = {0};
    for (long m = 0; m < p; m++) {
        add_scaled(&A, c[m], dtheta + 3 * (k - 1 - m));
        add_scaled(&B, c[m], dvel + 3 * (k - 1 - m));
    }
    vec theta = load(dtheta + 3 * k), v = load(dvel + 3 * k);
    vec last = load(dvel + 3 * (p ? k - 1 : k));
    vec coning = cross(A, theta), sculling_v = cross(A, v), sculling_theta = cross(B, theta);
    vec turn = cross(theta, v), turn2 = cross(theta, turn);
    double r1, r2, ratio = 0.0, share = 0.0, h = dt[k];
    rotation_factors(theta.x * theta.x + theta.y * theta.y + theta.z * theta.z, &r1, &r2);
    if (p) {
        ratio = h / dt[k - 1];
        share = ratio / (1.0 + ratio);
    }
#define AXIS(i)                                                                              \
    phi->i = theta.i + coning.i;                                                             \
    dv->i = v.i + r1 * turn.i + r2 * turn2.i + sculling_v.i + sculling_theta.i;              \
    dr->i = h * (0.5 * dv->i - (1.0 / 6.0) * (share * (v.i - ratio * last.i) + 0.5 * turn.i));
    AXIS(x)
    AXIS(y)
    AXIS(z)
#undef AXIS
}

static inline void sin_cos_near(double x, anchor near, double *sine, double *cosine)
{
    double x2 = x * x, sin_x = x * (1.0 - x2 * (1.0 / 6.0 - x2 * (1.0 / 120.0)));
    double versine = x2 * (0.5 - x2 * (1.0 / 24.0 - x2 * (1.0 / 720.0)));
    *sine = near.sine + (near.cosine * sin_x - near.sine * versine);
    *cosine = near.cosine - (near.sine * sin_x + near.cosine * versine);
}

static inline double middle_latitude(double lat, vec v, vec per_metre, double dt)
{
    return lat + 0.5 * dt * v.x * per_metre.x;
}

static inline place surroundings(const world *w, double sine, double cosine, double h, vec v)
{
    double squared = 1.0 - w->e2 * sine * sine, root = sqrt(squared), cube = squared * root;
    double per_meridian = cube / (w->a * (1.0 - w->e2) + h * cube);
    double per_transverse = root / (w->a + h * root);
    double per_cos = 1.0 / cosine;
    double ie_n = w->omega * cosine, ie_d = -w->omega * sine;
    double en_n = v.y * per_transverse, en_e = -v.x * per_meridian;
    double en_d = -en_n * (sine * per_cos);
    const double *c = w->down, *e = w->north;
    double s = sine * sine;
    double d0 = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * c[4])));
    double d1 = c[5] + s * (c[6] + s * (c[7] + s * c[8]));
    double d2 = c[9] + s * (c[10] + s * c[11]);
    double d3 = c[12] + s * c[13];
    double g_d = d0 + h * (d1 + h * (d2 + h * (d3 + h * c[14])));
    double north = e[0] + s * (e[1] + s * e[2]) + h * (e[3] + s * e[4] + h * e[5]);
    double g_n = north * sine * cosine * h;
    vec coriolis = cross((vec){2.0 * ie_n + en_n, en_e, 2.0 * ie_d + en_d}, v);
    return (place){
        {g_n - coriolis.x, -coriolis.y, g_d - coriolis.z},
        {ie_n + en_n, en_e, ie_d + en_d},
        {per_meridian, per_cos * per_transverse, -1.0},
    };
}

static inline vec predicted(vec v, vec D, vec W, vec rest, double dt)
{
    double half = 0.5 * dt * dt, k = half * (1.0 / 3.0);
    return (vec){
        (v.x * dt + D.x) + (half * rest.x - k * W.x),
        (v.y * dt + D.y) + (half * rest.y - k * W.y),
        (v.z * dt + D.z) + (half * rest.z - k * W.z),
    };
}

static inline vec corrected(vec moved, vec rest, vec before, double dt, double dt_before)
{
    double half = 0.5 * dt * dt, k = half - half * (1.0 / 3.0) * (dt / (dt + dt_before));
    return (vec){
        moved.x + k * (rest.x - before.x),
        moved.y + k * (rest.y - before.y),
        moved.z + k * (rest.z - before.z),
    };
}

static inline vec velocity_change(vec A, vec D, vec W, vec rest, vec rate, double dt)
{
    double k = dt * dt * (1.0 / 6.0);
    vec lag = {
        D.x - (dt * A.x - k * W.x),
        D.y - (dt * A.y - k * W.y),
        D.z - (dt * A.z - k * W.z),
    };
    vec turn = cross(rate, lag);
    return (vec){
        A.x + (rest.x * dt + turn.x),
        A.y + (rest.y * dt + turn.y),
        A.z + (rest.z * dt + turn.z),
    };
}

static inline quat attitude_after(quat q, vec phi, vec rate, double dt)
{
    quat turn = change_of(phi);
    quat frame = change_of((vec){-dt * rate.x, -dt * rate.y, -dt * rate.z});
    turn.w += 0.5 - 0.5 * (q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    turn = product(q, turn);
    quat half_way = {q.w + turn.w, q.x + turn.x, q.y + turn.y, q.z + turn.z};
    quat drag = product(frame, half_way);
    return (quat){half_way.w + drag.w, half_way.x + drag.x, half_way.y + drag.y,
                  half_way.z + drag.z};
}

static inline void add(double *sum, double *lost, double term)
{
    double y = term - *lost, new = *sum + y;
    *lost = (new - *sum) - y;
    *sum = new;
}

/* Start: lat, lon, h, v (3), q (4). Returns the rows done, fewer than n where the loop does not
 * apply: unequal intervals, beyond 89.9 degrees, or outside the gravity fit. */
long navigate(const world *w, const double *start, long n, const double *dt,
              const double *dtheta, const double *dvel, double *lat_out, double *lon_out,
              double *h_out, double *v_out, double *q_out)
{
    const double pi = 3.14159265358979323846, farthest = 89.9 * pi / 180.0;
    double lat = start[0], lon = start[1], h = start[2];
    double lost_lat = 0.0, lost_lon = 0.0, lost_h = 0.0, dt_before = 0.0;
    vec v = load(start + 3), lost_v = {0};
    quat q = {start[6], start[7], start[8], start[9]};
    anchor near = {lat, sin(lat), cos(lat)};
    place here = surroundings(w, near.sine, near.cosine, h, v);
    long k = 0;
renew:
    if (k < n && fabs(middle_latitude(lat, v, here.per_metre, dt[k]) - near.lat) > REACH)
        near = (anchor){lat, sin(lat), cos(lat)};
    for (long first = k; k < n; k++) {
        double T = dt[k], sine, cosine;
        if (k && fabs(T - dt[k - 1]) > 1e-8 * T)
            return k;
        double x = middle_latitude(lat, v, here.per_metre, T) - near.lat;
        if (fabs(x) > REACH && k > first)
            goto renew;
        vec phi, dv, dr;
        body(k, dt, dtheta, dvel, &phi, &dv, &dr);

        sin_cos_near(x, near, &sine, &cosine);
        double per_dt = 1.0 / T;
        vec A = rotate(q, dv), D = rotate(q, dr), W = cross(here.rate, A);
        vec moved = predicted(v, D, W, here.acceleration, T);
        double to_down = 0.25 * (T * v.z + moved.z);
        vec mean_v = {per_dt * moved.x, per_dt * moved.y, per_dt * moved.z};
        vec before = here.acceleration;
        here = surroundings(w, sine, cosine, h - to_down, mean_v);
        moved = corrected(moved, here.acceleration, before, T, dt_before);
        vec gain = velocity_change(A, D, W, here.acceleration, here.rate, T);
        add(&v.x, &lost_v.x, gain.x);
        add(&v.y, &lost_v.y, gain.y);
        add(&v.z, &lost_v.z, gain.z);
        q = attitude_after(q, phi, here.rate, T);
        dt_before = T;

        add(&lat, &lost_lat, moved.x * here.per_metre.x);
        add(&lon, &lost_lon, moved.y * here.per_metre.y);
        add(&h, &lost_h, -moved.z);
        if (lon > pi)
            lon -= 2.0 * pi;
        else if (lon < -pi)
            lon += 2.0 * pi;
        if (!(fabs(lat) <= farthest && h > -1000.0 && h < 20000.0))
            return k;
        lat_out[k] = lat;
        lon_out[k] = lon;
        h_out[k] = h;
        v_out[3 * k] = v.x;
        v_out[3 * k + 1] = v.y;
        v_out[3 * k + 2] = v.z;
        q_out[4 * k] = q.w;
        q_out[4 * k + 1] = q.x;
        q_out[4 * k + 2] = q.y;
        q_out[4 * k + 3] = q.z;
    }
    return n;
}
