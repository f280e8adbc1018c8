#include "io/store/job/job_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>

#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/store/hdf5/hdf5_file.h"
#include "io/store/job/job_lock.h"
#include "io/store/units/track_writer.h"
#include "io/store/units/tracks_file.h"
#include "tests/support/io/example_block.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr const char* kUnit = "tracks/000001.h5";

void put_bytes(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
}

template <typename Expected>
std::string what_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Expected& error) {
    return error.what();
  } catch (const std::exception& error) {
    return std::string("another error: ") + error.what();
  }
  return "no error";
}

// Runs in a child process; returns its wait status. A child that comes to the end of `action` exits with 0.
int in_child(const std::function<void()>& action) {
  const pid_t child = ::fork();
  if (child == 0) {
    try {
      action();
    } catch (const std::exception&) {
      ::_exit(99);
    }
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return status;
}

class Store : public ::testing::Test {
 protected:
  Store() { store_.create(); }
  UnitSeal write_example(std::uint64_t fingerprint = 42) {
    return store_.write(kUnit, fingerprint, [](const std::string& path) { write_tracks(path, example_tracks()); });
  }
  // As small as an HDF5 file gets: for loops over all of its bytes.
  void write_small(std::uint64_t fingerprint) {
    store_.write(kUnit, fingerprint, [](const std::string& path) {
      Hdf5Writer file(path, "small");
      file.vector("values", std::vector<double>{1, 2, 3});
      file.close();
    });
  }
  std::size_t files_in_tracks() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(store_.path("tracks")), {}));
  }

  ScratchDirectory scratch_;
  JobStore store_{scratch_.path("job")};
};

TEST_F(Store, SealedUnitIsUpToDateForItsFingerprintOnly) {
  EXPECT_FALSE(store_.up_to_date(kUnit, 42));
  EXPECT_FALSE(store_.seal(kUnit).has_value());
  const UnitSeal seal = write_example(42);
  EXPECT_TRUE(store_.up_to_date(kUnit, 42));
  EXPECT_FALSE(store_.up_to_date(kUnit, 43));
  ASSERT_TRUE(store_.seal(kUnit).has_value());
  EXPECT_EQ(store_.seal(kUnit)->content_hash, seal.content_hash);
  EXPECT_EQ(read_tracks(store_.verified_path(kUnit)).id, example_tracks().id);
  EXPECT_EQ(files_in_tracks(), 1u);
}

TEST_F(Store, TrailerHasTheDocumentedBytes) {
  write_example(0x0123456789abcdef);
  const std::string bytes = bytes_of(store_.path(kUnit));
  write_tracks(scratch_.path("plain.h5"), example_tracks());
  const std::string payload = bytes_of(scratch_.path("plain.h5"));
  ASSERT_EQ(bytes.size(), payload.size() + 64);
  EXPECT_EQ(bytes.substr(0, payload.size()), payload);
  const std::string trailer = bytes.substr(payload.size());
  const auto word = [&](std::size_t offset, std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t i = size; i-- > 0;) value = value << 8 | static_cast<unsigned char>(trailer[offset + i]);
    return value;
  };
  EXPECT_EQ(trailer.substr(0, 8), "MBUNIT\r\n");
  EXPECT_EQ(word(8, 4), kFormatVersion);
  EXPECT_EQ(word(16, 8), payload.size());
  Hasher of_payload, of_trailer;
  of_payload.bytes(payload.data(), payload.size());
  EXPECT_EQ(word(24, 8), of_payload.value());
  EXPECT_EQ(word(32, 8), 0x0123456789abcdefu);
  of_trailer.bytes(trailer.data(), 56);
  EXPECT_EQ(word(56, 8), of_trailer.value());
}

TEST_F(Store, RewritingReplacesTheUnit) {
  write_example(1);
  store_.write(kUnit, 2, [](const std::string& path) {
    TrackSet none;
    none.begin = {0};
    write_tracks(path, none);
  });
  EXPECT_TRUE(store_.up_to_date(kUnit, 2));
  EXPECT_EQ(read_tracks(store_.verified_path(kUnit)).track_count(), 0);
}

TEST_F(Store, WriterThatThrowsLeavesNothingBehind) {
  EXPECT_THROW(store_.write(kUnit, 1,
                            [](const std::string& path) {
                              put_bytes(path, "half a file");
                              throw ComputeError("singular");
                            }),
               ComputeError);
  EXPECT_EQ(files_in_tracks(), 0u);
}

TEST_F(Store, WriterThatThrowsKeepsTheOldUnit) {
  write_example(1);
  EXPECT_THROW(store_.write(kUnit, 2, [](const std::string&) { throw ComputeError("singular"); }), ComputeError);
  EXPECT_TRUE(store_.up_to_date(kUnit, 1));
  store_.verify(kUnit);
}

TEST_F(Store, EveryFlippedBitIsDetected) {
  write_small(42);
  const std::string good = bytes_of(store_.path(kUnit));
  std::fstream file(store_.path(kUnit), std::ios::binary | std::ios::in | std::ios::out);
  const auto put = [&](std::size_t position, char byte) {
    file.seekp(static_cast<std::streamoff>(position)).put(byte).flush();
  };
  std::size_t undetected = 0;
  for (std::size_t position = 0; position < good.size(); ++position) {
    put(position, static_cast<char>(good[position] ^ (1 << position % 8)));
    try {
      store_.verify(kUnit);
      ++undetected;
    } catch (const StoreError& error) {
      EXPECT_THAT(error.what(), HasSubstr(store_.path(kUnit)));
    }
    put(position, good[position]);
  }
  EXPECT_EQ(undetected, 0u);
  EXPECT_NO_THROW(store_.verify(kUnit));
}

TEST_F(Store, EveryTruncationIsDetectedWithoutReadingThePayload) {
  write_small(42);
  std::uint64_t size = fs::file_size(store_.path(kUnit));
  while (size-- > 0) {
    fs::resize_file(store_.path(kUnit), size);
    EXPECT_FALSE(store_.up_to_date(kUnit, 42)) << size;
    EXPECT_THROW(store_.verify(kUnit), StoreError) << size;
  }
}

TEST_F(Store, BytesBehindTheTrailerAreDetected) {
  write_example(42);
  std::ofstream(store_.path(kUnit), std::ios::app) << "x";
  EXPECT_FALSE(store_.up_to_date(kUnit, 42));
  EXPECT_THROW(store_.verify(kUnit), StoreError);
}

TEST_F(Store, DamageAfterVerificationIsFound) {
  write_example();
  store_.verified_path(kUnit);
  std::string bytes = bytes_of(store_.path(kUnit));
  bytes[100] = static_cast<char>(bytes[100] ^ 1);
  const fs::file_time_type before = fs::last_write_time(store_.path(kUnit));
  put_bytes(store_.path(kUnit), bytes);
  fs::last_write_time(store_.path(kUnit), before + std::chrono::milliseconds(1));
  EXPECT_THROW(store_.verified_path(kUnit), StoreError);
}

TEST_F(Store, AnotherFormatVersionIsSaid) {
  write_example(42);
  std::string bytes = bytes_of(store_.path(kUnit));
  std::string trailer = bytes.substr(bytes.size() - 64);
  trailer[8] = 77;
  Hasher hasher;
  hasher.bytes(trailer.data(), 56);
  const std::uint64_t hash = hasher.value();
  std::memcpy(&trailer[56], &hash, sizeof hash);
  put_bytes(store_.path(kUnit), bytes.substr(0, bytes.size() - 64) + trailer);
  EXPECT_THAT(what_of<StoreError>([&] { store_.verify(kUnit); }), HasSubstr("format version 77"));
  EXPECT_FALSE(store_.up_to_date(kUnit, 42));
}

TEST_F(Store, MissingUnitIsNamed) {
  EXPECT_THAT(what_of<StoreError>([&] { store_.verify("tracks/000007.h5"); }),
              HasSubstr("tracks/000007.h5: is missing"));
}

TEST_F(Store, KillDuringWritingLeavesNoUnit) {
  const int status = in_child([&] {
    store_.write(kUnit, 42, [](const std::string& path) {
      write_tracks(path, example_tracks());
      ::kill(::getpid(), SIGKILL);
    });
  });
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_FALSE(fs::exists(store_.path(kUnit)));
  EXPECT_EQ(files_in_tracks(), 1u);  // the temporary
  EXPECT_THAT(store_.list("tracks"), IsEmpty());
  store_.remove_temporaries();
  EXPECT_EQ(files_in_tracks(), 0u);
}

TEST_F(Store, TemporaryOfALivingProcessStays) {
  store_.write(kUnit, 42, [&](const std::string& path) {
    write_tracks(path, example_tracks());
    const int status = in_child([&] { store_.remove_temporaries(); });
    EXPECT_EQ(status, 0);
    EXPECT_TRUE(fs::exists(path));
  });
  EXPECT_TRUE(store_.up_to_date(kUnit, 42));
}

TEST_F(Store, ListIsSortedAndWithoutTemporaries) {
  for (const char* unit : {"merge/0001/000002.h5", "tracks/000010.h5", "tracks/000002.h5"})
    store_.write(unit, 1, [](const std::string& path) { put_bytes(path, "x"); });
  put_bytes(store_.path("tracks/.000003.h5~elsewhere~12~34.tmp"), "half");
  EXPECT_THAT(store_.list("tracks"), ElementsAre("tracks/000002.h5", "tracks/000010.h5"));
  EXPECT_THAT(store_.list("merge"), ElementsAre("merge/0001/000002.h5"));
  EXPECT_THAT(store_.list("nowhere"), IsEmpty());
}

TEST_F(Store, RemoveForgetsTheUnit) {
  write_example(42);
  store_.verified_path(kUnit);
  store_.remove(kUnit);
  store_.remove(kUnit);
  EXPECT_FALSE(store_.up_to_date(kUnit, 42));
  EXPECT_THROW(store_.verified_path(kUnit), StoreError);
}

TEST_F(Store, TextIsReplacedAtOnce) {
  store_.write_text("job.json", "{}\n");
  store_.write_text("job.json", "{\"a\": 1}\n");
  EXPECT_EQ(bytes_of(store_.path("job.json")), "{\"a\": 1}\n");
}

TEST_F(Store, FileInTheWayOfTheJobIsNamed) {
  put_bytes(scratch_.path("blocked"), "a file");
  const JobStore blocked(scratch_.path("blocked/job"));
  EXPECT_THAT(what_of<InputError>([&] { blocked.create(); }), HasSubstr("a file is where a directory is needed"));
  EXPECT_THAT(what_of<InputError>([&] { blocked.write_text("job.json", ""); }),
              HasSubstr("a file is where a directory is needed"));
}

TEST_F(Store, DirectoryInTheWayOfAUnitIsNamed) {
  fs::create_directories(store_.path("tracks/000001.h5/inside"));
  const std::string message = what_of<InputError>([&] { write_example(); });
  EXPECT_THAT(message, HasSubstr(store_.path(kUnit)));
  EXPECT_THAT(message, HasSubstr("a directory is where a file is needed"));
}

TEST_F(Store, FileSizeLimitIsSaidAndTheProcessGoesOn) {
  std::string message;
  const int status = in_child([&] {
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{1000, 1000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    const std::string found = what_of<InputError>([&] { write_example(); });
    if (found.find(store_.path(kUnit) + ": cannot be written: larger than the file size limit") == std::string::npos)
      ::_exit(1);
    if (files_in_tracks() != 0) ::_exit(2);
    store_.write_text("job.json", "{}");  // small files can still be written
    std::exit(0);                         // HDF5 closes itself without a crash
  });
  EXPECT_EQ(status, 0);
}

// Writes a file of more than 20 MiB, which HDF5 puts on the disk itself, where that is the limit: 0 when the limit is
// said, no file is left and HDF5 closes itself without a crash.
int status_of_too_large(const std::string& path, const std::function<void()>& write) {
  return in_child([&] {
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{20 << 20, 20 << 20};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    const std::string found = what_of<InputError>(write);
    if (found.find(path + ": cannot be written: larger than the file size limit") == std::string::npos) ::_exit(1);
    if (fs::exists(path)) ::_exit(2);
    std::exit(0);
  });
}

TEST_F(Store, FileSizeLimitIsSaidWhileTracksAreAppended) {
  const std::string path = scratch_.path("large.h5");
  EXPECT_EQ(status_of_too_large(path,
                                [&] {
                                  TrackWriter writer(path);
                                  TrackSet batch;
                                  batch.begin = {0};
                                  for (std::int64_t t = 0; t < 1000000; ++t) {
                                    const auto noise = static_cast<std::int32_t>(t * 0x9e3779b9);
                                    batch.id.push_back(TrackIndex(t));
                                    batch.image.push_back(ImageIndex(noise & 0xffff));
                                    batch.x.push_back(noise);
                                    batch.y.push_back(-noise);
                                    batch.feature.push_back(noise ^ 0x5555);
                                    batch.begin.push_back(t + 1);
                                  }
                                  for (;;) {
                                    writer.append(batch);
                                    for (TrackIndex& id : batch.id) id.value += 1000000;
                                  }
                                }),
            0);
}

TEST_F(Store, FileSizeLimitIsSaidOfTables) {
  const std::string path = scratch_.path("large.h5");
  const auto numbers = [](Hdf5Writer& file) { file.vector("noise", std::vector<double>(3000000, 0.5)); };
  const auto texts = [](Hdf5Writer& file) {
    file.texts("noise", 1000000, [](std::int64_t i) { return std::to_string(i * 0x9e3779b97f4a7c15u) + "abcd"; });
  };
  for (const std::function<void(Hdf5Writer&)>& fill : {std::function<void(Hdf5Writer&)>(numbers), {texts}})
    EXPECT_EQ(status_of_too_large(path,
                                  [&] {
                                    Hdf5Writer file(path, "noise", Hdf5Storage::kDisk);
                                    fill(file);
                                    file.close();
                                  }),
              0);
}

TEST_F(Store, FullDiskAndReadOnlyDiskAreSaid) {
  // A small file system of its own, where the test may mount one (root); elsewhere it is skipped, as nothing else fills
  // a disk or makes it read-only.
  const std::string mount_point = scratch_.path("disk");
  fs::create_directories(mount_point);
  if (::mount("tmpfs", mount_point.c_str(), "tmpfs", 0, "size=64k") != 0)
    GTEST_SKIP() << "needs the right to mount; the file size limit is tested without";
  const JobStore store(mount_point + "/job");
  store.create();
  std::string full, read_only;
  full = what_of<InputError>([&] {
    store.write(kUnit, 1, [](const std::string& path) {
      write_tracks(path, example_tracks());
      Hdf5Writer file(path, "noise");
      std::vector<std::uint64_t> noise(100000);
      for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = i * 0x9e3779b97f4a7c15u;
      file.vector("noise", noise);
      file.close();
    });
  });
  const bool nothing_left = fs::is_empty(store.path("tracks"));
  ::mount("tmpfs", mount_point.c_str(), "tmpfs", MS_REMOUNT | MS_RDONLY, "size=64k");
  read_only = what_of<InputError>([&] { store.write_text("job.json", "{}"); });
  ::umount(mount_point.c_str());
  EXPECT_THAT(full, HasSubstr("no space left on the device"));
  EXPECT_THAT(full, Not(HasSubstr(".tmp")));
  EXPECT_TRUE(nothing_left);
  EXPECT_THAT(read_only, HasSubstr("the file system is read-only"));
}

TEST_F(Store, SecondLockIsRefusedNamingTheHolder) {
  const JobLock lock(store_, 0);
  const pid_t holder = ::getpid();
  const int status = in_child([&] {
    // Opens the lock file anew, so that the lock is not the one inherited.
    const std::string message = what_of<InputError>([&] { const JobLock second(store_, 0.1); });
    ::_exit(message.find("process " + std::to_string(holder) + " on ") == std::string::npos);
  });
  EXPECT_EQ(status, 0);
}

TEST_F(Store, LockIsFreeAfterItsHolderWasKilled) {
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const JobLock lock(store_, 0);
    if (::write(ready[1], "x", 1) != 1) ::_exit(1);
    for (;;) ::pause();
  }
  char byte;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  EXPECT_THAT(what_of<InputError>([&] { const JobLock second(store_, 0); }),
              HasSubstr("process " + std::to_string(child)));
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_NO_THROW({ const JobLock second(store_, 5); });
}

TEST_F(Store, LockIsFreeAfterItsObjectIsGone) {
  { const JobLock lock(store_, 0); }
  EXPECT_NO_THROW({ const JobLock again(store_, 0); });
}

}  // namespace
}  // namespace megablock
