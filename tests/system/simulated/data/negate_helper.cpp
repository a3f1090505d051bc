#include "negate_helper.h"

float opposite(float value) {
    return -value;
}

double opposite(double value) {
    return -value;
}
