// geometry_msgs/Quaternion to geometry_msgs/Point: roll (x), pitch (y) and yaw (z) in rad.
//
// Half angles after Bernardes and Viollet (2022): no asin, so nothing is lost near the gimbal lock, and no
// division by the length, so the quaternion need not be a unit. An infinite or NaN component gives NaN, a
// quaternion without a normal component gives zeros; no result is -0.

#include <cfloat>
#include <cmath>
#include <limits>

static const double PI = 3.14159265358979323846;

// The same angle in (-pi, pi]. Adding 0.0 turns -0 into 0.
static double wrap(double angle) {
    if (angle > PI) {
        angle -= 2.0 * PI;
    } else if (angle <= -PI) {
        angle += 2.0 * PI;
    }
    return angle + 0.0;
}

static double larger(double a, double b) {
    return a > b ? a : b;
}

void QuaternionToEuler(double x_in, double y_in, double z_in, double w_in,
                       double *x_out, double *y_out, double *z_out) {
#pragma HLS INTERFACE mode=ap_none port=x_in
#pragma HLS INTERFACE mode=ap_none port=y_in
#pragma HLS INTERFACE mode=ap_none port=z_in
#pragma HLS INTERFACE mode=ap_none port=w_in
#pragma HLS INTERFACE mode=ap_vld port=x_out
#pragma HLS INTERFACE mode=ap_vld port=y_out
#pragma HLS INTERFACE mode=ap_vld port=z_out
#pragma HLS INTERFACE mode=ap_ctrl_hs port=return
    if (!std::isfinite(x_in) || !std::isfinite(y_in) || !std::isfinite(z_in) || !std::isfinite(w_in)) {
        *x_out = *y_out = *z_out = std::numeric_limits<double>::quiet_NaN();
        return;
    }
    const double largest = larger(larger(std::fabs(x_in), std::fabs(y_in)), larger(std::fabs(z_in), std::fabs(w_in)));
    if (largest < DBL_MIN) {
        *x_out = *y_out = *z_out = 0.0;
        return;
    }

    // Scaled to at most 1, so that nothing overflows; only the ratio counts.
    int exponent;
    std::frexp(largest, &exponent);
    const double x = std::ldexp(x_in, -exponent);
    const double y = std::ldexp(y_in, -exponent);
    const double z = std::ldexp(z_in, -exponent);
    const double w = std::ldexp(w_in, -exponent);

    // Adding 0.0 turns -0 into 0, for atan2(0, -0) is pi.
    const double p = w + y + 0.0;
    const double q = w - y + 0.0;
    const double r = x + z;
    const double s = z - x;
    const double alpha = std::atan2(r, q);
    const double beta = std::atan2(s, p);

    *x_out = wrap(alpha - beta);
    *y_out = 2.0 * std::atan2(std::sqrt(p * p + s * s), std::sqrt(q * q + r * r)) - 0.5 * PI + 0.0;
    *z_out = wrap(alpha + beta);
}
