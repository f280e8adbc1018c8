// Handles the signals that stop a run.
//
// SIGUSR1 stops gracefully: ranks claim no further units, finish their present one and return 75. SIGTERM and SIGINT
// abandon the present units at once, and the process ends with 75. The store is valid in either case, because a unit
// file appears complete or not at all.
#pragma once

namespace megablock {

// Blocks the three signals in this and all later threads, and starts the thread that waits for them. Call it first in
// main().
void watch_signals();

// True after SIGUSR1.
bool stop_requested();

// Call it before work that the same command does not resume: the message of SIGTERM and SIGINT says so.
void work_begins_anew();

// Call it when all ranks have finished. mpirun sends SIGTERM to the other ranks when one has ended with an exit code;
// the signal then still ends the process, but without a message.
void end_of_work();

}  // namespace megablock
