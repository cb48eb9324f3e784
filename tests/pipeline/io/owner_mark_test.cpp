#include "pipeline/io/machine.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "pipeline/io/file_stamp.h"

namespace texmesh::owner_mark_test {

constexpr std::int64_t kHour_ns = 3'600'000'000'000, kDay_ns = 24 * kHour_ns;

/// A number that was a process's a moment ago.
pid_t dead_process() {
  const pid_t pid = ::fork();
  if (pid == 0) ::_exit(0);
  ::waitpid(pid, nullptr, 0);
  return pid;
}

std::string with_pid(pid_t pid) {
  const std::string own = owner_mark();
  return own.substr(0, own.rfind('-') + 1) + std::to_string(pid);
}

TEST(OwnerMark, OfThisMachineTheProcessDecidesAndNotTheAge) {
  const std::string own = owner_mark();
  ASSERT_TRUE(is_owner_mark(own)) << own;
  EXPECT_TRUE(own.ends_with("-" + std::to_string(::getpid()))) << own;
  const std::int64_t now = wall_clock_ns();
  EXPECT_TRUE(owner_may_live(own, now));
  EXPECT_TRUE(owner_may_live(own, now - 100 * kDay_ns)) << "a live process keeps its files, however old";
  EXPECT_TRUE(owner_may_live(with_pid(1), now)) << "another's process, which may not be signalled, lives";
  const std::string dead = with_pid(dead_process());
  EXPECT_FALSE(owner_may_live(dead, now)) << dead;
}

TEST(OwnerMark, AProcessThatNobodyAsksForIsDead) {
  const pid_t pid = ::fork();
  if (pid == 0) ::_exit(0);
  siginfo_t ended{};
  ASSERT_EQ(::waitid(P_PID, static_cast<id_t>(pid), &ended, WEXITED | WNOWAIT), 0);
  EXPECT_FALSE(owner_may_live(with_pid(pid), wall_clock_ns()));
  ::waitpid(pid, nullptr, 0);
}

TEST(OwnerMark, OfAnotherMachineTheAgeDecides) {
  const std::int64_t now = wall_clock_ns();
  for (const std::string& mark :
       {"node7-0123456789ab-" + std::to_string(::getpid()), std::string("no mark"), std::string()}) {
    EXPECT_TRUE(owner_may_live(mark, now)) << mark;
    EXPECT_TRUE(owner_may_live(mark, now - 23 * kHour_ns)) << mark;
    EXPECT_FALSE(owner_may_live(mark, now - 25 * kHour_ns)) << mark;
  }
}

TEST(OwnerMark, OtherTextsAreNone) {
  for (const char* text : {"", "-", "--", "a-b-c", "-0123456789ab-1", "a-0123456789ab-", "a-0123456789ab-0",
                           "a-0123456789ab-1x", "a-0123456789ab--1", "a-0123456789aB-1", "a-0123456789a-1",
                           "a-0123456789abc-1", "a-0123456789ab-99999999999999999999"})
    EXPECT_FALSE(is_owner_mark(text)) << text;
  EXPECT_TRUE(is_owner_mark("a-0123456789ab-1"));
}

}  // namespace texmesh::owner_mark_test
