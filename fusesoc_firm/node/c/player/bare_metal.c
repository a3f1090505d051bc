/* SPDX-License-Identifier: Apache-2.0 */
/* Without an operating system: one loop. */
#include "firm_board.h"
#include "firm_player.h"

int main(void) {
    firm_board_start();
    firm_player_open();
    for (;;) {
        int has_moved = firm_player_put();
        has_moved |= firm_player_carry();
        if (!has_moved) {
            firm_board_wait();
        }
    }
}
