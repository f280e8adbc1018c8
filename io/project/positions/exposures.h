// Finds the images that belong to exposures and to a path of the antenna, by numbers, order and times. Internal to io/.
//
// An exposure belongs to the image
//     1. whose name ends in its number ("100_0001_0023.JPG", "DJI_20210601102030_0023_W.JPG"), if all images of the
//        folder have such numbers, the file has all of them, and images of one number (of several cameras) have one
//        time;
//     2. of the same rank in the order of time (of name, where headers have no times), if there are as many exposures;
//     3. taken at its time. The clock of a camera has an unknown offset from GPS time; the one counts with which most
//        exposures fall on images, if no other does nearly as well.
// In 1 and 2 all offsets between header and exposure must agree within 3 s, else the file belongs to other images.
//
// Path: images are interpolated at their times, by the cubic through the four epochs around where these lie within 4 s,
// else linearly; across more than 5 s there is no position. Attitudes turn evenly from one epoch to the next. A time
// whose zone is unknown is taken in the one zone (in steps of a quarter of an hour) that puts the images onto the path.
#pragma once

#include <string>
#include <vector>

#include "io/project/positions/position_table.h"

namespace megablock {

// What the header of an image says of its time; NaN where it says nothing.
struct ImageTime {
  std::string name;
  double gps_s = kNoNumber;    // GPS time, seconds since 1970, where the header states receiver time or zone
  double clock_s = kNoNumber;  // DateTimeOriginal, seconds since 1970 of an unknown zone
};

// The row of each image in a table of exposures; -1: none. Throws InputError if they cannot be told apart.
std::vector<std::int64_t> rows_of_images(const PositionTable& table, const std::vector<ImageTime>& images,
                                         const std::string& path);

// Makes seconds of the GPS week absolute, in the week in which the images were taken. Other times stay.
void make_absolute(PositionTable& path, const std::vector<ImageTime>& images);

// A row for each time on the path, sorted as the times are; its `where` is empty off the path.
std::vector<PositionTable::Row> interpolate(const PositionTable& path, const std::vector<double>& times_s);

// GPS times of images on a path, NaN where the header has none. `offset_s`: GPS time minus the time of the header; NaN:
// found as above. Adds a note about the zone. Throws InputError if no zone fits, or several do.
std::vector<double> times_on_path(const PositionTable& path, const std::vector<ImageTime>& images, double offset_s,
                                  const std::string& file, std::vector<std::string>& notes);

// The rows of images at their times; `where` is empty for those off the path. Makes the times of the path absolute.
// Times in whole seconds add 0.3 s of motion to the sigmas, with a note.
std::vector<PositionTable::Row> rows_on_path(PositionTable& path, const std::vector<ImageTime>& images, double offset_s,
                                             const std::string& file);

// Exposures (_Timestamp.MRK) whose places come from a better solution of the antenna: from its path, or from its events
// of the same times. The offsets of the exposures stay. Those off the path are left out with a note.
PositionTable exposures_on(const PositionTable& solution, const PositionTable& exposures, const std::string& file,
                           std::vector<std::string>& notes);

}  // namespace megablock
