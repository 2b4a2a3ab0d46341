// What people are told of an environment beyond its spec.
#pragma once

#include <string>
#include <vector>

namespace dbr {

// An opponent whose score is shown while a run goes on.
struct WatchedOpponent {
  std::string name;
  std::string short_name;  // for narrow terminals
};

// A mean score that a paper printed, with its standard deviation.
struct PublishedScore {
  std::string opponent;
  double mean = 0;
  double std = 0;
};

// What a paper printed of one algorithm.
struct PublishedColumn {
  std::string algorithm;  // as configs name it
  std::string label;      // as people do
  std::vector<PublishedScore> scores;
};

// A plain value. The default is that of a game of one whose episodes have a return and no score.
struct EnvPresentation {
  std::string episodes = "episodes";       // what its episodes are called, in the plural
  std::string short_episodes = "ep";       // the same for narrow terminals
  std::string opponents;                   // which it knows, for help texts; empty: it has none
  std::string scoring;                     // a sentence on how an episode is scored; empty: by its return
  std::vector<WatchedOpponent> watched;    // empty: the mean return is shown while a run goes on
  std::vector<PublishedColumn> published;  // beside the table of final results; empty: nothing is
};

}  // namespace dbr
