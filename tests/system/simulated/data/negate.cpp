// Every bit of a whole number and the sign of a float turned over; outputs by reference.
#include <cassert>
#include <cstdint>

#include "negate_helper.h"

void negate(bool done_in, std::int8_t i_in, std::uint8_t words_in, std::int16_t value_in, std::uint16_t index_in,
            std::int32_t remaining_in, std::uint32_t status_in, std::int64_t result_in, std::uint64_t first_in,
            float start_in, double run_in, bool &done_out, std::int8_t &i_out, std::uint8_t &words_out,
            std::int16_t &value_out, std::uint16_t &index_out, std::int32_t &remaining_out, std::uint32_t &status_out,
            std::int64_t &result_out, std::uint64_t &first_out, float &start_out, double &run_out) {
    done_out = !done_in;
    i_out = opposite(i_in);
    words_out = opposite(words_in);
    value_out = opposite(value_in);
    index_out = opposite(index_in);
    remaining_out = opposite(remaining_in);
    status_out = opposite(status_in);
    result_out = opposite(result_in);
    first_out = opposite(first_in);
    start_out = opposite(start_in);
    run_out = opposite(run_in);
    assert(i_out != i_in);  // its text holds this file's name, which must not depend on where the file lies
}
