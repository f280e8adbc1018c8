// Stores places and registrations of a trajectory in files (shapes, types and units: docs/reference/file-formats.md,
// "Registration").
#pragma once

#include <string>
#include <vector>

#include "io/block/registration.h"

namespace megablock {

// Files of places, registrations and trajectories. They throw StoreError for files that cannot be read.
void write_places(const std::string& path, const std::vector<Place>& places);
std::vector<Place> read_places(const std::string& path);

void write_registrations(const std::string& path, const std::vector<RegisteredPlace>& places);
std::vector<RegisteredPlace> read_registrations(const std::string& path);

void write_trajectory(const std::string& path, const RegisteredTrajectory& trajectory);
RegisteredTrajectory read_trajectory(const std::string& path);

}  // namespace megablock
