// Gives the tracks of a result in global order in batches. The tracks of a block of a million images do not fit into
// memory, so no function may need all of them at once.
#pragma once

#include <functional>
#include <string>

#include "io/result/result.h"

namespace megablock {

class TrackBatches {
 public:
  virtual ~TrackBatches() = default;
  virtual std::int64_t track_count() const = 0;
  // Calls `visit` with batches of whole tracks. Indices ascend within a batch and from batch to batch. All batches have
  // the same optional columns.
  using Visit = std::function<void(const TrackResults&)>;
  virtual void visit(const Visit& visit) const = 0;
};

// Tracks in memory, as one batch. They must outlive this object.
class WholeTracks final : public TrackBatches {
 public:
  explicit WholeTracks(const TrackResults& tracks) : tracks_(tracks) {}
  std::int64_t track_count() const override { return tracks_.tracks.track_count(); }
  void visit(const Visit& visit) const override { visit(tracks_); }

 private:
  const TrackResults& tracks_;
};

// The tracks in the file of a result. Throws as read_result does.
class StoredTracks final : public TrackBatches {
 public:
  explicit StoredTracks(std::string path);
  std::int64_t track_count() const override { return count_; }
  void visit(const Visit& visit) const override;

 private:
  std::string path_;
  std::int64_t count_ = 0;
};

// Visits every n-th track, with the smallest n that gives at most `most` tracks. `visit` gets the batch and the row.
void visit_sample(const TrackBatches& tracks, std::int64_t most,
                  const std::function<void(const TrackResults& batch, std::size_t row)>& visit);
TrackResults sample_of(const TrackBatches& tracks, std::int64_t most);

}  // namespace megablock
