#pragma once
#include <string>
#include <vector>

namespace texmesh {

/// A line or a row of dots of a Plot.
struct PlotSeries {
  std::string name;    // plain text; "" = not in the legend
  std::string colour;  // class of the page's style: "a" to "e", or "q" for what stands back
  std::vector<std::pair<double, double>> points;
  bool strong = false, dashed = false, dots = false;
  bool steps = false;  // horizontal from each point to the next, not straight
};

/// A picture of lines for the page, as SVG in the page's colours.
struct Plot {
  std::string title, x_name, y_name;  // plain text; the title is what a reader who sees no picture gets
  double x_low = 1, x_high = 10;      // x_low < x_high; 0 < x_low on a logarithmic axis
  double y_high = 1;                  // the vertical axis goes from y_low to at least this
  double y_low = 0;                   // 0, or below: then the axis goes to this at least
  bool linear_x = false;              // the horizontal axis; else it is logarithmic
  std::vector<PlotSeries> series;
  std::string svg() const;
};

}  // namespace texmesh
