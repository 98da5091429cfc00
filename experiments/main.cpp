#include "experiments/command_line.h"

int main(int argc, char** argv) { return arboretum::command_line(argc, argv); }
