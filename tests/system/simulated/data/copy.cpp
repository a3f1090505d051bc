// What comes in; outputs by pointer.
#include <cstdint>

void copy(bool done_in, int8_t i_in, uint8_t words_in, int16_t value_in, uint16_t index_in, int32_t remaining_in,
          uint32_t status_in, int64_t result_in, uint64_t first_in, float start_in, double run_in, bool *done_out,
          int8_t *i_out, uint8_t *words_out, int16_t *value_out, uint16_t *index_out, int32_t *remaining_out,
          uint32_t *status_out, int64_t *result_out, uint64_t *first_out, float *start_out, double *run_out) {
    *done_out = done_in;
    *i_out = i_in;
    *words_out = words_in;
    *value_out = value_in;
    *index_out = index_in;
    *remaining_out = remaining_in;
    *status_out = status_in;
    *result_out = result_in;
    *first_out = first_in;
    *start_out = start_in;
    *run_out = run_in;
}
