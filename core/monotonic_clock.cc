#include "core/monotonic_clock.h"

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <thread>
#include <utility>

#include "core/shutdown.h"

namespace dbr {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;

// One wait that has a deadline. It lies on the stack of the thread that waits.
struct Alarm {
  absl::Mutex* mutex;
  bool rung = false;  // guarded by `mutex`
};

// Rings alarms: at its time each one is marked under its own mutex, which lets the wait end. There is one for
// the process, never destroyed, because a thread may wait until the process ends.
class AlarmClock {
 public:
  using Place = std::pair<SteadyTime, std::uint64_t>;  // the second tells alarms of one time apart

  static AlarmClock& Get() {
    static auto* clock = new AlarmClock;
    return *clock;
  }

  Place Set(SteadyTime when, Alarm* alarm) {
    const std::lock_guard lock(mutex_);
    const Place place = {when, ++set_};
    alarms_[place] = alarm;
    if (alarms_.begin()->first == place) changed_.notify_one();
    return place;
  }

  // False where the alarm rings or has rung: then it may be destroyed only when it has been marked.
  bool Cancel(const Place& place) {
    const std::lock_guard lock(mutex_);
    return alarms_.erase(place) > 0;
  }

 private:
  AlarmClock() : thread_(ThreadWithoutSignals([this] { Run(); })) {}

  [[noreturn]] void Run() {
    std::unique_lock lock(mutex_);
    for (;;) {
      if (alarms_.empty()) {
        changed_.wait(lock);
      } else if (const SteadyTime next = alarms_.begin()->first.first;
                 std::chrono::steady_clock::now() < next) {
        changed_.wait_until(lock, next);
      } else {
        Alarm* const due = alarms_.begin()->second;
        alarms_.erase(alarms_.begin());
        lock.unlock();
        Ring(due);
        lock.lock();
      }
    }
  }

  // Once the mark is set and the mutex is free, the alarm may be gone.
  static void Ring(Alarm* alarm) {
    absl::MutexLock lock(alarm->mutex);
    alarm->rung = true;
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<Place, Alarm*> alarms_;
  std::uint64_t set_ = 0;  // how many alarms were set
  std::thread thread_;
};

}  // namespace

absl::Time MonotonicNow() {
  return absl::UnixEpoch() + absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch());
}

bool AwaitUntil(absl::Mutex* mutex, const absl::Condition& condition, absl::Time deadline) {
  if (condition.Eval()) return true;
  if (deadline == absl::InfiniteFuture()) {
    mutex->Await(condition);
    return true;
  }
  const absl::Duration left = deadline - MonotonicNow();
  if (left <= absl::ZeroDuration()) return false;
  Alarm alarm = {mutex};
  const AlarmClock::Place place =
      AlarmClock::Get().Set(std::chrono::steady_clock::now() + absl::ToChronoNanoseconds(left), &alarm);
  const auto over = [&alarm, &condition] { return alarm.rung || condition.Eval(); };
  mutex->Await(absl::Condition(&over));
  if (!AlarmClock::Get().Cancel(place)) mutex->Await(absl::Condition(&alarm.rung));
  return condition.Eval();
}

bool AwaitFor(absl::Mutex* mutex, const absl::Condition& condition, absl::Duration timeout) {
  return AwaitUntil(mutex, condition, MonotonicNow() + timeout);
}

}  // namespace dbr
