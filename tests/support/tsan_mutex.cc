// absl::Mutex and absl::CondVar on top of POSIX ones, only for builds with ThreadSanitizer.
//
// The distribution's Abseil is a shared library that ThreadSanitizer has not instrumented. It sees neither
// that a Mutex was taken nor that a waiter was woken, and reports every guarded member as a race. A program's
// own definitions come before a shared library's, so the definitions below replace Abseil's, for us and for
// gRPC. They are slower, and readers exclude each other. The contracts are the same.
#include <pthread.h>
#include <sanitizer/tsan_interface.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <ctime>

#include "absl/synchronization/mutex.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "core/check.h"

// The link options name this symbol, so that the linker takes this file out of its archive.
extern "C" const int dbr_tsan_mutex = 1;

// These libraries use memory inside functions that ThreadSanitizer intercepts (free, memcpy). They order that
// by atomics that it does not see either.
extern "C" const char* __tsan_default_suppressions() {
  return "called_from_lib:libgrpc.so\n"
         "called_from_lib:libgrpc++.so\n"
         "called_from_lib:libgrpc++_reflection.so\n"
         "called_from_lib:libgpr.so\n"
         "called_from_lib:libprotobuf.so\n"
         "called_from_lib:libabsl_time_zone.so\n"
         "called_from_lib:libabsl_status.so\n"
         "called_from_lib:libabsl_statusor.so\n"
         "called_from_lib:libabsl_strings.so\n"
         "called_from_lib:libabsl_cord.so\n"
         "called_from_lib:libabsl_cord_internal.so\n"
         // The last owner of gRPC's thread pool frees its condition variables. The count of a shared_ptr in
         // the uninstrumented library orders that.
         "race:grpc_event_engine::experimental::ThreadPool::State\n";
}

namespace dbr {
namespace {

// The state of a Mutex. `changed` wakes those who wait for a condition, because any unlock may have made it
// true.
struct Lock {
  pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
  pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
  int waiting = 0;

  ~Lock() {
    pthread_cond_destroy(&changed);
    pthread_mutex_destroy(&mutex);
  }
};

struct Signal {
  pthread_cond_t cond = PTHREAD_COND_INITIALIZER;

  ~Signal() { pthread_cond_destroy(&cond); }
};

static_assert(sizeof(absl::Mutex) == sizeof(std::atomic<void*>) &&
              sizeof(absl::CondVar) == sizeof(std::atomic<void*>));

// The only word of a Mutex or CondVar, which is zero at first, holds the address of its state.
template <class Behind>
std::atomic<Behind*>& WordOf(const void* object) {
  return *static_cast<std::atomic<Behind*>*>(const_cast<void*>(object));
}

template <class Behind>
Behind& Of(const void* object) {
  std::atomic<Behind*>& word = WordOf<Behind>(object);
  Behind* found = word.load();
  if (found != nullptr) return *found;
  auto* made = new Behind;
  if (word.compare_exchange_strong(found, made)) return *made;
  delete made;
  return *found;
}

// Every use of the state ends with a release, and its destruction begins with an acquire. gRPC counts
// references to the owners of its mutexes by atomics that ThreadSanitizer does not see.
template <class Behind>
void Destroy(const void* object) {
  Behind* behind = WordOf<Behind>(object).exchange(nullptr);
  if (behind != nullptr) __tsan_acquire(behind);
  delete behind;
}

void WakeWaiters(Lock& lock) {
  if (lock.waiting > 0) pthread_cond_broadcast(&lock.changed);
}

void LockIt(const absl::Mutex* mutex) {
  DBR_CHECK(pthread_mutex_lock(&Of<Lock>(mutex).mutex) == 0);
}

void UnlockIt(const absl::Mutex* mutex) {
  Lock& lock = Of<Lock>(mutex);
  WakeWaiters(lock);
  __tsan_release(&lock);
  DBR_CHECK(pthread_mutex_unlock(&lock.mutex) == 0);
}

// Returns false once `deadline` has passed.
bool WaitOn(pthread_cond_t* cond, pthread_mutex_t* mutex, absl::Time deadline) {
  if (deadline == absl::InfiniteFuture()) return pthread_cond_wait(cond, mutex) == 0;
  const timespec until = absl::ToTimespec(deadline);
  return pthread_cond_timedwait(cond, mutex, &until) != ETIMEDOUT;
}

bool AwaitIt(const absl::Mutex* mutex, const absl::Condition& condition, absl::Time deadline) {
  Lock& lock = Of<Lock>(mutex);
  bool in_time = true;
  while (!condition.Eval()) {
    if (!in_time) return false;
    WakeWaiters(lock);
    ++lock.waiting;
    in_time = WaitOn(&lock.changed, &lock.mutex, deadline);
    --lock.waiting;
  }
  return true;
}

// Returns true where the deadline passed first, as CondVar::WaitWithDeadline does.
bool WaitForSignal(const absl::CondVar* cond_var, const absl::Mutex* mutex, absl::Time deadline) {
  Lock& lock = Of<Lock>(mutex);
  WakeWaiters(lock);
  Signal& signal = Of<Signal>(cond_var);
  const bool in_time = WaitOn(&signal.cond, &lock.mutex, deadline);
  __tsan_release(&signal);
  return !in_time;
}

// Returns the signal of a CondVar. Once it wakes the other thread, that thread may destroy it.
pthread_cond_t* LastUse(const absl::CondVar* cond_var) {
  Signal& signal = Of<Signal>(cond_var);
  __tsan_release(&signal);
  return &signal.cond;
}

absl::Time After(absl::Duration timeout) {
  return timeout == absl::InfiniteDuration() ? absl::InfiniteFuture() : absl::Now() + timeout;
}

}  // namespace
}  // namespace dbr

namespace absl {
ABSL_NAMESPACE_BEGIN

Mutex::~Mutex() {
  dbr::Destroy<dbr::Lock>(this);
}
void Mutex::Lock() {
  dbr::LockIt(this);
}
void Mutex::Unlock() {
  dbr::UnlockIt(this);
}
bool Mutex::TryLock() {
  return pthread_mutex_trylock(&dbr::Of<dbr::Lock>(this).mutex) == 0;
}
void Mutex::ReaderLock() {
  dbr::LockIt(this);
}
void Mutex::ReaderUnlock() {
  dbr::UnlockIt(this);
}
bool Mutex::ReaderTryLock() {
  return pthread_mutex_trylock(&dbr::Of<dbr::Lock>(this).mutex) == 0;
}
void Mutex::AssertHeld() const {}
void Mutex::AssertReaderHeld() const {}
void Mutex::AssertNotHeld() const {}
void Mutex::ForgetDeadlockInfo() {}
void Mutex::EnableDebugLog(const char*) {}
void Mutex::EnableInvariantDebugging(void (*)(void*), void*) {}

void Mutex::Await(const Condition& condition) {
  dbr::AwaitIt(this, condition, InfiniteFuture());
}
bool Mutex::AwaitWithTimeout(const Condition& condition, Duration timeout) {
  return dbr::AwaitIt(this, condition, dbr::After(timeout));
}
bool Mutex::AwaitWithDeadline(const Condition& condition, Time deadline) {
  return dbr::AwaitIt(this, condition, deadline);
}
void Mutex::LockWhen(const Condition& condition) {
  LockWhenWithDeadline(condition, InfiniteFuture());
}
bool Mutex::LockWhenWithTimeout(const Condition& condition, Duration timeout) {
  return LockWhenWithDeadline(condition, dbr::After(timeout));
}
bool Mutex::LockWhenWithDeadline(const Condition& condition, Time deadline) {
  dbr::LockIt(this);
  return dbr::AwaitIt(this, condition, deadline);
}
void Mutex::ReaderLockWhen(const Condition& condition) {
  LockWhenWithDeadline(condition, InfiniteFuture());
}
bool Mutex::ReaderLockWhenWithTimeout(const Condition& condition, Duration timeout) {
  return LockWhenWithDeadline(condition, dbr::After(timeout));
}
bool Mutex::ReaderLockWhenWithDeadline(const Condition& condition, Time deadline) {
  return LockWhenWithDeadline(condition, deadline);
}

CondVar::~CondVar() {
  dbr::Destroy<dbr::Signal>(this);
}
void CondVar::Wait(Mutex* mutex) {
  dbr::WaitForSignal(this, mutex, InfiniteFuture());
}
bool CondVar::WaitWithTimeout(Mutex* mutex, Duration timeout) {
  return dbr::WaitForSignal(this, mutex, dbr::After(timeout));
}
bool CondVar::WaitWithDeadline(Mutex* mutex, Time deadline) {
  return dbr::WaitForSignal(this, mutex, deadline);
}
void CondVar::Signal() {
  pthread_cond_signal(dbr::LastUse(this));
}
void CondVar::SignalAll() {
  pthread_cond_broadcast(dbr::LastUse(this));
}
void CondVar::EnableDebugLog(const char*) {}

ABSL_NAMESPACE_END
}  // namespace absl
