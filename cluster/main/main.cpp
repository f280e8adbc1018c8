// Runs the program megablock, which orients blocks of images, tile by tile, on any number of ranks. Sample runs:
//   megablock init images -o block.yaml
//   megablock run block.yaml -j job
//   mpirun --bind-to none -n 2 megablock run block.yaml -j job

#include "cluster/commands/command_line.h"
#include "cluster/process/arithmetic.h"
#include "cluster/process/signals.h"

int main(int argc, char** argv) {
  megablock::watch_signals();
  return megablock::command_line(argc, argv);
}
