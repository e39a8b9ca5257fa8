#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "devices/pattern_sequencer.h"

namespace crosstie::devices {

/// A screen of the desktop; projectors are screens, too.
struct Screen {
  int index = 0;  ///< for WindowSequencerOptions
  std::string name;
  int x_px = 0;  ///< of its first pixel on the desktop
  int y_px = 0;
  int width_px = 0;
  int height_px = 0;
  double refresh_hz = 0.0;  ///< 0: unknown
};

/// The screens of the desktop as they are now. Errors: kDevice where there is no desktop.
[[nodiscard]] base::Result<std::vector<Screen>> list_screens();

struct WindowSequencerOptions {
  int screen = 1;  ///< index of the projector's screen. Default: the first one beside the operator's
  /// Refreshes for which a picture is shown before step() returns, after the one that presented it: what compositor, cable and projector
  /// keep back. Default: two for a compositor and the projector's own frame buffer; one that scales or smoothes needs more.
  int settle_refreshes = 3;
  double assumed_refresh_hz = 60.0;  ///< where the screen does not say

  [[nodiscard]] base::Result<> validate() const;
};

/// A projector that is a screen: a window over all of it, without cursor, that shows each pattern pixel by pixel.
///
/// upload() opens the window, black, and refuses patterns of another size than the screen's: scaled stripes are no stripes of the sequence.
/// step() shows the next pattern and returns after it was presented and settle_refreshes more have passed, by the screen's vertical
/// synchronisation and by the clock. arm() leaves the picture as it is. Screensavers are kept off while it is open.
///
/// A window that is closed, hidden or resized and a screen that is lost are kDevice errors of the next step(); upload() opens it anew. SDL has one owner in a process: one window at a time, and no other use of SDL beside it. X11 ends a
/// program whose X server dies; that cannot be survived.
class WindowSequencer : public PatternSequencer {
 public:
  /// Errors: kUsage for options out of their domain, or where a window sequencer is alive already; kDevice without a desktop or such a
  /// screen (with the list of those that there are).
  static base::Result<std::unique_ptr<WindowSequencer>> open(const WindowSequencerOptions& options = {});

  /// The window's picture, read back from the renderer. Error kDevice where no window is open.
  [[nodiscard]] virtual base::Result<base::Image> picture() = 0;
  /// Closes the window; upload() opens it again.
  virtual void close() = 0;
};

}  // namespace crosstie::devices
