#include <cstdint>

void difference(std::int32_t data_in0, std::int32_t data_in1, std::int64_t &data_out0, bool *data_out1) {
    data_out0 = static_cast<std::int64_t>(data_in0) - data_in1;
    *data_out1 = data_out0 < 0;
}
