// The tracks of a result in global order, batch by batch: of a block of a million images they are never held whole.
#pragma once

#include <functional>
#include <string>

#include "io/result/result.h"

namespace megablock {

class TrackBatches {
 public:
  virtual ~TrackBatches() = default;
  virtual std::int64_t track_count() const = 0;
  // Batches of whole tracks, ascending by index within a batch and from one to the next; all of them have the same
  // optional columns.
  using Visit = std::function<void(const TrackResults&)>;
  virtual void visit(const Visit& visit) const = 0;
};

// Tracks in memory, as one batch. They outlive it.
class WholeTracks final : public TrackBatches {
 public:
  explicit WholeTracks(const TrackResults& tracks) : tracks_(tracks) {}
  std::int64_t track_count() const override { return tracks_.tracks.track_count(); }
  void visit(const Visit& visit) const override { visit(tracks_); }

 private:
  const TrackResults& tracks_;
};

// Those of a result's file. Errors: as read_result.
class StoredTracks final : public TrackBatches {
 public:
  explicit StoredTracks(std::string path);
  std::int64_t track_count() const override { return count_; }
  void visit(const Visit& visit) const override;

 private:
  std::string path_;
  std::int64_t count_ = 0;
};

// Every n-th track, n such that there are no more than `most`: the batch and the row in it.
void visit_sample(const TrackBatches& tracks, std::int64_t most,
                  const std::function<void(const TrackResults& batch, std::size_t row)>& visit);
TrackResults sample_of(const TrackBatches& tracks, std::int64_t most);

}  // namespace megablock
