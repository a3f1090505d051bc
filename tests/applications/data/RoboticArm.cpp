// robotic_arm/ArmState to robotic_arm/ArmPoses: the poses of the seven joints of an arm, as specs/robotic_arm.
//
// The arithmetic is that of specs/robotic_arm/model.py, to the last bit: fixed point with FRACTION bits, sine and
// cosine by CORDIC.

#include <cmath>
#include <cstdint>
#include <limits>

static const int JOINTS = 7;
static const int STEPS = 8;
static const int FRACTION = 29;
static const std::int64_t ONE = std::int64_t(1) << FRACTION;
// Fraction bits of CORDIC beyond FRACTION, and bits that a square loses before it is added.
static const int GUARD = 6;
static const int SQUARE_CUT = 8;
// Of a given pose's elements and of all numbers, in units.
static const std::int64_t ELEMENT_LIMIT = 4 * ONE;
static const std::int64_t LIMIT = 16 * ONE;

// Denavit and Hartenberg's parameters of the joints and the hand: quarter turns about x, lengths in units.
static const int TURNS[STEPS] = {0, -1, 1, 1, -1, 1, 1, 0};
static const std::int64_t A[STEPS] = {0, 0, 0, 44291850, -44291850, 0, 47244640, 0};
static const std::int64_t D[STEPS] = {178778014, 0, 169651208, 0, 206158430, 0, 0, 112957640};
static const double HAND_ANGLE = -0.7853981633974483;

// pi, 2 pi and 4 pi in units; atan(2**-k) and the length that all rotations bring to 1, with GUARD more bits.
static const std::int64_t PI = 1686629713;
static const std::int64_t TWO_PI = 3373259426;
static const std::int64_t FOUR_PI = 6746518852;
// 13/8 rad: sincos_of folds angles from here on.
static const std::int64_t FOLDED_FROM = 872415232;
static const std::int64_t START = 20865051970;
static const std::int64_t ANGLES[FRACTION] = {
    26986075409, 15930810540, 8417402771, 4272805077, 2144693981, 1073392503,
    536827228, 268429995, 134217045, 67108779, 33554421, 16777215,
    8388608, 4194304, 2097152, 1048576, 524288, 262144,
    131072, 65536, 32768, 16384, 8192, 4096,
    2048, 1024, 512, 256, 128
};

// A row of a pose: the elements of its columns x, y, z and p.
struct Row {
    std::int64_t x, y, z, p;
};

// Rounded to nearest, ties away from zero; false if the number is beyond LIMIT.
static bool to_fixed(double number, std::int64_t &units) {
    units = 0;
    if (!std::isfinite(number) || std::fabs(number) > 2 * 16) {
        return false;
    }
    const double scaled = std::ldexp(std::fabs(number), FRACTION);
    const double whole = std::floor(scaled);
    const std::int64_t magnitude = std::int64_t(whole) + (scaled - whole >= 0.5 ? 1 : 0);
    if (magnitude >= LIMIT) {
        return false;
    }
    units = number < 0 ? -magnitude : magnitude;
    return true;
}

static std::int64_t rounded(std::int64_t number, int bits) {
    return (number + (std::int64_t(1) << (bits - 1))) >> bits;
}

static std::int64_t product(std::int64_t left, std::int64_t right) {
    return rounded(left * right, FRACTION);
}

// The same angle in -pi to pi.
static std::int64_t fold(std::int64_t angle) {
    if (angle > TWO_PI + PI || angle < -TWO_PI - PI) {
        angle += angle > 0 ? -FOUR_PI : FOUR_PI;
    }
    if (angle > PI || angle < -PI) {
        angle += angle > 0 ? -TWO_PI : TWO_PI;
    }
    return angle;
}

static void sincos_of(std::int64_t angle, std::int64_t &cosine, std::int64_t &sine) {
    std::int64_t left = angle * (1 << GUARD);
    std::int64_t x = START;
    std::int64_t y = 0;
    if (angle >= FOLDED_FROM || angle < -FOLDED_FROM) {
        left += left > 0 ? -4 * ANGLES[0] : 4 * ANGLES[0];
        x = -x;
    }
    for (int k = 0; k < FRACTION; k++) {
        const std::int64_t old = x;
        if (left < 0) {
            x += y >> k;
            y -= old >> k;
            left += ANGLES[k];
        } else {
            x -= y >> k;
            y += old >> k;
            left -= ANGLES[k];
        }
    }
    cosine = rounded(x, GUARD);
    sine = rounded(y, GUARD);
}

// A row of the pose after a step.
static Row turned(const Row &row, int step, std::int64_t cosine, std::int64_t sine) {
    const int sign = TURNS[step];
    const std::int64_t across = sign ? row.z : row.y;
    const std::int64_t along = sign ? row.y : row.z;
    std::int64_t by_sine = product(across, sine);
    std::int64_t by_cosine = product(across, cosine);
    if (sign < 0) {
        by_sine = -by_sine;
        by_cosine = -by_cosine;
    }
    const std::int64_t by_length = product(along, D[step]);
    Row result;
    result.x = product(row.x, cosine) + by_sine;
    result.y = by_cosine - product(row.x, sine);
    result.z = sign ? -sign * row.y : row.z;
    result.p = row.p + product(row.x, A[step]) + (sign > 0 ? -by_length : by_length);
    return result;
}

// The elements of a pose, column by column.
static void elements_of(const Row rows[3], std::int64_t elements[16]) {
    for (int k = 0; k < 3; k++) {
        elements[k] = rows[k].x;
        elements[4 + k] = rows[k].y;
        elements[8 + k] = rows[k].z;
        elements[12 + k] = rows[k].p;
    }
    elements[3] = elements[7] = elements[11] = 0;
    elements[15] = ONE;
}

// The pose of each joint, and the mean square error of the given pose of the end effector.
static void chain(const double angles[JOINTS], const double given[16], double poses[JOINTS][16], double &error) {
    const double undefined = std::numeric_limits<double>::quiet_NaN();
    Row rows[3] = {{ONE, 0, 0, 0}, {0, ONE, 0, 0}, {0, 0, ONE, 0}};
    std::int64_t own[16];
    bool is_fit = true;
    for (int step = 0; step < STEPS; step++) {
        std::int64_t angle, cosine, sine;
        is_fit = to_fixed(step < JOINTS ? angles[step] : HAND_ANGLE, angle) && is_fit;
        sincos_of(fold(angle), cosine, sine);
        for (int k = 0; k < 3; k++) {
            rows[k] = turned(rows[k], step, cosine, sine);
        }
        elements_of(rows, own);
        if (step < JOINTS) {
            for (int k = 0; k < 16; k++) {
                // Only a computed element can be undefined: the last row is constant.
                poses[step][k] = is_fit || k % 4 == 3 ? std::ldexp(double(own[k]), -FRACTION) : undefined;
            }
        }
    }

    std::int64_t total = 0;
    for (int k = 0; k < 16; k++) {
        std::int64_t element;
        is_fit = to_fixed(given[k], element) && is_fit;
        is_fit = is_fit && element >= -ELEMENT_LIMIT && element < ELEMENT_LIMIT;
        if (is_fit) {
            const std::int64_t difference = own[k] - element;
            total += (difference * difference) >> SQUARE_CUT;
        }
    }
    error = is_fit ? std::ldexp(double(total), -(2 * FRACTION - SQUARE_CUT + 4)) : undefined;
}

void RoboticArm(
    double q_in[7], double q_d_in[7], double o_t_ee_in[16], double o_t_ee_d_in[16], double t1_out[16],
    double t2_out[16], double t3_out[16], double t4_out[16], double t5_out[16], double t6_out[16],
    double t7_out[16], double t1_d_out[16], double t2_d_out[16], double t3_d_out[16], double t4_d_out[16],
    double t5_d_out[16], double t6_d_out[16], double t7_d_out[16], double *t_mse_out, double *t_mse_d_out
) {
#pragma HLS INTERFACE mode=ap_none port=q_in
#pragma HLS ARRAY_PARTITION variable=q_in type=complete
#pragma HLS INTERFACE mode=ap_none port=q_d_in
#pragma HLS ARRAY_PARTITION variable=q_d_in type=complete
#pragma HLS INTERFACE mode=ap_none port=o_t_ee_in
#pragma HLS ARRAY_PARTITION variable=o_t_ee_in type=complete
#pragma HLS INTERFACE mode=ap_none port=o_t_ee_d_in
#pragma HLS ARRAY_PARTITION variable=o_t_ee_d_in type=complete
#pragma HLS INTERFACE mode=ap_vld port=t1_out
#pragma HLS ARRAY_PARTITION variable=t1_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t2_out
#pragma HLS ARRAY_PARTITION variable=t2_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t3_out
#pragma HLS ARRAY_PARTITION variable=t3_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t4_out
#pragma HLS ARRAY_PARTITION variable=t4_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t5_out
#pragma HLS ARRAY_PARTITION variable=t5_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t6_out
#pragma HLS ARRAY_PARTITION variable=t6_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t7_out
#pragma HLS ARRAY_PARTITION variable=t7_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t1_d_out
#pragma HLS ARRAY_PARTITION variable=t1_d_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t2_d_out
#pragma HLS ARRAY_PARTITION variable=t2_d_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t3_d_out
#pragma HLS ARRAY_PARTITION variable=t3_d_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t4_d_out
#pragma HLS ARRAY_PARTITION variable=t4_d_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t5_d_out
#pragma HLS ARRAY_PARTITION variable=t5_d_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t6_d_out
#pragma HLS ARRAY_PARTITION variable=t6_d_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t7_d_out
#pragma HLS ARRAY_PARTITION variable=t7_d_out type=complete
#pragma HLS INTERFACE mode=ap_vld port=t_mse_out
#pragma HLS INTERFACE mode=ap_vld port=t_mse_d_out
#pragma HLS INTERFACE mode=ap_ctrl_hs port=return
    double poses[JOINTS][16];
    double *const measured[JOINTS] = {t1_out, t2_out, t3_out, t4_out, t5_out, t6_out, t7_out};
    double *const desired[JOINTS] = {t1_d_out, t2_d_out, t3_d_out, t4_d_out, t5_d_out, t6_d_out, t7_d_out};

    chain(q_in, o_t_ee_in, poses, *t_mse_out);
    for (int joint = 0; joint < JOINTS; joint++) {
        for (int k = 0; k < 16; k++) {
            measured[joint][k] = poses[joint][k];
        }
    }
    chain(q_d_in, o_t_ee_d_in, poses, *t_mse_d_out);
    for (int joint = 0; joint < JOINTS; joint++) {
        for (int k = 0; k < 16; k++) {
            desired[joint][k] = poses[joint][k];
        }
    }
}
