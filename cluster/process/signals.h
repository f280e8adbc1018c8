// Stopping.
//
// SIGUSR1: graceful; the work queue hands out no further units, all ranks finish the one in hand and return 75.
// SIGTERM, SIGINT: the units in hand are abandoned at once and the process leaves with 75. The store is valid either
// way: units appear whole or not at all.
#pragma once

namespace megablock {

// Blocks the three signals in this and all later threads and starts the thread that waits for them. Call first in main.
void watch_signals();

// True once a graceful stop was asked for.
bool stop_requested();

// The ranks have come to their end together and have nothing in hand: SIGTERM, which mpirun sends to those that leave
// after one with an exit code, still ends the process, but says nothing.
void end_of_work();

}  // namespace megablock
