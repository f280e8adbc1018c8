// A column is written in one of the forms of packed_columns.h, and begins with the number of its values. Where a type
// has two forms, a byte says which follows, and the shorter one is chosen by counting before anything is written. Every
// form gives back the bits of the values: doubles are compared as bits, and a value becomes a multiple of kPixelUnit
// only if multiplying back gives the same bits. Unpacking goes through a buffer of one chunk, with no copy of the whole
// column.
#include "merge/scratch/packed_columns.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <type_traits>

#include "io/block/tracks.h"

namespace megablock {

namespace {

constexpr std::size_t kChunk = 16384;  // values at a time: they stay in the second cache

template <typename T>
void write(std::ostream& file, const T* first, std::size_t count) {
  file.write(reinterpret_cast<const char*>(first), static_cast<std::streamsize>(count * sizeof(T)));
}
template <typename T>
void write(std::ostream& file, const T& value) {
  write(file, &value, 1);
}

template <typename T>
bool read(std::istream& file, T* first, std::size_t count) {
  return !!file.read(reinterpret_cast<char*>(first), static_cast<std::streamsize>(count * sizeof(T)));
}
template <typename T>
bool read(std::istream& file, T& value) {
  return read(file, &value, 1);
}

// Calls visit(first, size) for each chunk of `count` values, until visit returns false.
template <typename Visit>
void visit_chunks(std::size_t count, Visit&& visit) {
  for (std::size_t first = 0; first < count; first += kChunk)
    if (!visit(first, std::min(kChunk, count - first))) return;
}

// Writes and reads values as another type, chunk by chunk. narrow(number) gives each stored value, take(number, value)
// receives it.
template <typename Stored, typename Narrow>
void write_as(std::ostream& file, std::size_t count, Narrow&& narrow) {
  std::array<Stored, kChunk> chunk;
  visit_chunks(count, [&](std::size_t first, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) chunk[i] = narrow(first + i);
    write(file, chunk.data(), size);
    return true;
  });
}
template <typename Stored, typename Take>
void read_as(std::istream& file, std::size_t count, Take&& take) {
  std::array<Stored, kChunk> chunk;
  visit_chunks(count, [&](std::size_t first, std::size_t size) {
    if (!read(file, chunk.data(), size)) return false;
    for (std::size_t i = 0; i < size; ++i) take(first + i, chunk[i]);
    return true;
  });
}

// The range of a column of integers. Differences from the least value are unsigned; they wrap around, and back when
// they are added again.
struct Integers {
  std::uint64_t least = 0;
  std::uint8_t width = 0;  // bytes
  template <typename Value>
  Integers(std::size_t count, Value&& value) {
    if (count == 0) return;
    std::int64_t low = value(0), high = low;
    for (std::size_t i = 1; i < count; ++i) {
      low = std::min<std::int64_t>(low, value(i));
      high = std::max<std::int64_t>(high, value(i));
    }
    least = static_cast<std::uint64_t>(low);
    // The width is the next power of two of the bytes that the largest difference needs; 0 where all values are equal.
    const int bits = std::bit_width(static_cast<std::uint64_t>(high) - least);
    width = static_cast<std::uint8_t>(std::bit_ceil(static_cast<unsigned>((bits + 7) / 8)) * (bits > 0));
  }
  Integers() = default;
};

// Calls visit with a zero of the unsigned type of this width (0: without a call). Returns false when there is no type
// of this width.
template <typename Visit>
bool with_width(std::uint8_t width, Visit&& visit) {
  if (width == 1) visit(std::uint8_t{0});
  if (width == 2) visit(std::uint16_t{0});
  if (width == 4) visit(std::uint32_t{0});
  if (width == 8) visit(std::uint64_t{0});
  return width <= 8 && (width == 0 || std::has_single_bit(width));
}

template <typename Value>
void write_integers(std::ostream& file, std::size_t count, Value&& value) {
  const Integers form(count, value);
  write(file, form.least);
  write(file, form.width);
  with_width(form.width, [&]<typename Stored>(Stored) {
    write_as<Stored>(file, count, [&](std::size_t i) {
      return static_cast<Stored>(static_cast<std::uint64_t>(value(i)) - form.least);
    });
  });
}

template <typename Take>
void read_integers(std::istream& file, std::size_t count, Take&& take) {
  Integers form;
  if (!read(file, form.least) || !read(file, form.width)) return;
  if (form.width == 0)
    for (std::size_t i = 0; i < count; ++i) take(i, static_cast<std::int64_t>(form.least));
  const bool known = with_width(form.width, [&]<typename Stored>(Stored) {
    read_as<Stored>(file, count,
                    [&](std::size_t i, Stored stored) { take(i, static_cast<std::int64_t>(form.least + stored)); });
  });
  if (!known) file.setstate(std::ios::failbit);
}

// A difference that is too large wraps around, and so does the sum that undoes it.
std::int64_t difference(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
}

template <typename Value>
// The first value, then the differences of neighbours as integers of the least width: in ascending lists these are
// small.
void write_steps(std::ostream& file, std::size_t count, Value&& value) {
  const std::int64_t first = count > 0 ? value(0) : 0;
  write(file, first);
  if (count > 1) write_integers(file, count - 1, [&](std::size_t i) { return difference(value(i + 1), value(i)); });
}

template <typename Take>
void read_steps(std::istream& file, std::size_t count, Take&& take) {
  std::int64_t last = 0;
  if (!read(file, last) || count == 0) return;
  take(0, last);
  if (count > 1)
    read_integers(file, count - 1, [&](std::size_t i, std::int64_t step) {
      last = difference(last, difference(0, step));
      take(i + 1, last);
    });
}

// Compares bits, so that -0 differs from 0.
template <typename T>
bool same_bits(T a, T b) {
  if constexpr (std::is_same_v<T, double>)
    return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
  else
    return a == b;
}

template <typename T>
// A run is stored as its value and its length.
constexpr std::size_t kRunBytes = sizeof(T) + sizeof(std::uint32_t);

template <typename T, typename Value>
std::size_t count_runs(std::size_t count, Value&& value) {
  std::size_t runs = count > 0;
  for (std::size_t i = 1; i < count; ++i) runs += !same_bits<T>(value(i), value(i - 1));
  return runs;
}

template <typename T, typename Value>
void write_runs(std::ostream& file, std::size_t count, Value&& value) {
  constexpr std::size_t kLongest = std::numeric_limits<std::uint32_t>::max();
  for (std::size_t first = 0, last = 0; first < count; first = last) {
    while (last < count && last - first < kLongest && same_bits<T>(value(last), value(first))) ++last;
    write<T>(file, value(first));
    write(file, static_cast<std::uint32_t>(last - first));
  }
}

template <typename T, typename Take>
// A length that does not fit marks a damaged file.
void read_runs(std::istream& file, std::size_t count, Take&& take) {
  for (std::size_t i = 0; i < count;) {
    T value;
    std::uint32_t length = 0;
    if (!read(file, value) || !read(file, length)) return;
    if (length == 0 || length > count - i) return file.setstate(std::ios::failbit);
    for (const std::size_t end = i + length; i < end; ++i) take(i, value);
  }
}

enum class Form : std::uint8_t { kRuns, kEach };

// Whether the value is a whole number of pixel units that 4 bytes can hold. Casting a value that 4 bytes cannot hold
// would be undefined, so its size is tested first; the test is false for NaN.
bool is_pixels(double value) {
  const double units = value / kPixelUnit;
  return std::abs(units) < 0x1p31 && same_bits(static_cast<std::int32_t>(units) * kPixelUnit, value);
}

template <typename Value>
void write_bytes(std::ostream& file, std::size_t count, Value&& value) {
  const bool runs = count_runs<std::uint8_t>(count, value) * kRunBytes<std::uint8_t> <= count;
  write(file, runs ? Form::kRuns : Form::kEach);
  if (runs)
    write_runs<std::uint8_t>(file, count, value);
  else
    write_as<std::uint8_t>(file, count, value);
}

template <typename Take>
void read_bytes(std::istream& file, std::size_t count, Take&& take) {
  Form form;
  if (!read(file, form)) return;
  if (form == Form::kRuns) return read_runs<std::uint8_t>(file, count, take);
  if (form == Form::kEach) return read_as<std::uint8_t>(file, count, take);
  file.setstate(std::ios::failbit);
}

void write_count(std::ostream& file, std::size_t count) { write(file, static_cast<std::uint64_t>(count)); }

// Reads the number of values, which must be `count`, and makes room for them.
template <typename T>
bool read_count(std::istream& file, std::size_t count, std::vector<T>& values) {
  std::uint64_t stored = 0;
  if (!read(file, stored)) return false;
  if (stored != count)
    file.setstate(std::ios::failbit);
  else
    values.resize(count);
  return !!file;
}

}  // namespace

void write_column(std::ostream& file, const std::vector<double>& values) {
  const std::size_t count = values.size();
  const auto value = [&](std::size_t i) { return values[i]; };
  write_count(file, count);
  // Runs if they are no longer than 4 bytes a value, the best that the other form can do.
  if (count_runs<double>(count, value) * kRunBytes<double> <= count * sizeof(std::int32_t)) {
    write(file, Form::kRuns);
    return write_runs<double>(file, count, value);
  }
  write(file, Form::kEach);
  const auto pixels = static_cast<std::size_t>(std::ranges::find_if_not(values, is_pixels) - values.begin());
  write_count(file, pixels);
  write_as<std::int32_t>(file, pixels,
                         [&](std::size_t i) { return static_cast<std::int32_t>(values[i] / kPixelUnit); });
  write(file, values.data() + pixels, count - pixels);
}

void read_column(std::istream& file, std::size_t count, std::vector<double>& values) {
  if (!read_count(file, count, values)) return;
  double* out = values.data();
  Form form;
  if (!read(file, form)) return;
  if (form == Form::kRuns) return read_runs<double>(file, count, [&](std::size_t i, double value) { out[i] = value; });
  std::uint64_t pixels = 0;
  if (!read(file, pixels)) return;
  if (form != Form::kEach || pixels > count) return file.setstate(std::ios::failbit);
  read_as<std::int32_t>(file, pixels, [&](std::size_t i, std::int32_t units) { out[i] = units * kPixelUnit; });
  if (file) read(file, out + pixels, count - pixels);
}

void write_column(std::ostream& file, const std::vector<std::uint8_t>& values) {
  write_count(file, values.size());
  write_bytes(file, values.size(), [&](std::size_t i) { return values[i]; });
}

void read_column(std::istream& file, std::size_t count, std::vector<std::uint8_t>& values) {
  if (!read_count(file, count, values)) return;
  read_bytes(file, count, [out = values.data()](std::size_t i, std::uint8_t value) { out[i] = value; });
}

void write_column(std::ostream& file, const std::vector<std::int64_t>& values) {
  write_count(file, values.size());
  write_steps(file, values.size(), [&](std::size_t i) { return values[i]; });
}

void read_column(std::istream& file, std::size_t count, std::vector<std::int64_t>& values) {
  if (!read_count(file, count, values)) return;
  read_steps(file, count, [out = values.data()](std::size_t i, std::int64_t value) { out[i] = value; });
}

void write_column(std::ostream& file, const std::vector<LocalImage>& values) {
  write_count(file, values.size());
  write_integers(file, values.size(), [&](std::size_t i) { return std::int64_t{values[i].value}; });
}

void read_column(std::istream& file, std::size_t count, std::vector<LocalImage>& values) {
  if (!read_count(file, count, values)) return;
  read_integers(file, count, [out = values.data()](std::size_t i, std::int64_t value) {
    out[i] = LocalImage(static_cast<std::int32_t>(value));
  });
}

void write_column(std::ostream& file, const std::vector<TilePoint>& values) {
  write_count(file, values.size());
  write_bytes(file, values.size(), [&](std::size_t i) { return static_cast<std::uint8_t>(values[i].role); });
  write_steps(file, values.size(), [&](std::size_t i) { return values[i].index; });
}

void read_column(std::istream& file, std::size_t count, std::vector<TilePoint>& values) {
  if (!read_count(file, count, values)) return;
  TilePoint* out = values.data();
  read_bytes(file, count, [&](std::size_t i, std::uint8_t role) { out[i].role = static_cast<PointRole>(role); });
  read_steps(file, count, [&](std::size_t i, std::int64_t index) { out[i].index = index; });
}

}  // namespace megablock
