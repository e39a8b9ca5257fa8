#include "devices/window_sequencer.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <thread>
#include <utility>

#include <SDL.h>
#include <fmt/format.h>

#include "devices/detail/sdl_thread.h"
#include "devices/host_time.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using detail::SdlThread;

template <auto kDestroy>
struct Destroy {
  template <typename T>
  void operator()(T* object) const {
    kDestroy(object);
  }
};
using Window = std::unique_ptr<SDL_Window, Destroy<SDL_DestroyWindow>>;
using Renderer = std::unique_ptr<SDL_Renderer, Destroy<SDL_DestroyRenderer>>;
using Texture = std::unique_ptr<SDL_Texture, Destroy<SDL_DestroyTexture>>;

tl::unexpected<base::Error> failed(const std::string& what) {
  return base::fail(ErrorCode::kDevice, fmt::format("projector: {}: {}", what, SDL_GetError()));
}

/// On SDL's thread.
std::vector<Screen> screens_now() {
  std::vector<Screen> screens;
  for (int i = 0; i < SDL_GetNumVideoDisplays(); ++i) {
    SDL_Rect place{};
    SDL_DisplayMode mode{};
    if (SDL_GetDisplayBounds(i, &place) != 0 || SDL_GetDesktopDisplayMode(i, &mode) != 0) continue;
    const char* name = SDL_GetDisplayName(i);
    screens.push_back(
        {i, name == nullptr ? "" : name, place.x, place.y, mode.w, mode.h, static_cast<double>(mode.refresh_rate)});
  }
  return screens;
}

std::optional<Screen> screen_of(const std::vector<Screen>& screens, int index) {
  const auto one = std::find_if(screens.begin(), screens.end(), [&](const Screen& screen) { return screen.index == index; });
  return one == screens.end() ? std::nullopt : std::optional(*one);
}

base::Result<Screen> find_screen(int index) {
  const std::vector<Screen> screens = screens_now();
  if (auto found = screen_of(screens, index)) return *std::move(found);
  std::vector<std::string> names;
  for (const Screen& one : screens)
    names.push_back(fmt::format("{} ({}, {} x {} px)", one.index, one.name, one.width_px, one.height_px));
  return base::fail(ErrorCode::kDevice,
                    fmt::format("projector: there is no screen {}; there are {}", index, fmt::join(names, ", ")));
}

/// The window with all that belongs to it; made, used and destroyed on SDL's thread.
class ShownWindow {
 public:
  static base::Result<std::unique_ptr<ShownWindow>> open(const Screen& screen) {
    auto shown = std::unique_ptr<ShownWindow>(new ShownWindow);
    shown->screen_ = screen.index;
    shown->window_.reset(SDL_CreateWindow("crosstie projector", static_cast<int>(SDL_WINDOWPOS_CENTERED_DISPLAY(screen.index)),
                                          static_cast<int>(SDL_WINDOWPOS_CENTERED_DISPLAY(screen.index)), screen.width_px,
                                          screen.height_px, SDL_WINDOW_FULLSCREEN_DESKTOP | SDL_WINDOW_ALLOW_HIGHDPI));
    if (!shown->window_) return failed("no window");
    shown->renderer_.reset(SDL_CreateRenderer(shown->window_.get(), -1, SDL_RENDERER_PRESENTVSYNC));
    if (!shown->renderer_) shown->renderer_.reset(SDL_CreateRenderer(shown->window_.get(), -1, SDL_RENDERER_SOFTWARE));
    if (!shown->renderer_) return failed("nothing that draws");
    int width = 0, height = 0;
    if (SDL_GetRendererOutputSize(shown->renderer_.get(), &width, &height) != 0) return failed("the window has no size");
    if (width != screen.width_px || height != screen.height_px) {
      return base::fail(ErrorCode::kDevice, fmt::format("projector: the window got {} x {} px of a screen of {} x {} px", width,
                                                        height, screen.width_px, screen.height_px));
    }
    shown->width_ = width;
    shown->height_ = height;
    shown->texture_.reset(
        SDL_CreateTexture(shown->renderer_.get(), SDL_PIXELFORMAT_ARGB8888, SDL_TEXTUREACCESS_STREAMING, width, height));
    if (!shown->texture_) return failed("no picture of the screen's size");
    SDL_SetTextureBlendMode(shown->texture_.get(), SDL_BLENDMODE_NONE);
    SDL_ShowCursor(SDL_DISABLE);
    SDL_DisableScreenSaver();
    const base::Image black(width, height, 8);
    if (auto drawn = shown->draw(black); !drawn) return base::fail(std::move(drawn));
    shown->present();
    return shown;
  }
  ~ShownWindow() {
    SDL_ShowCursor(SDL_ENABLE);
    SDL_EnableScreenSaver();
  }
  ShownWindow(const ShownWindow&) = delete;
  ShownWindow& operator=(const ShownWindow&) = delete;

  base::Result<> draw(const base::Image& image) {
    void* pixels = nullptr;
    int pitch_bytes = 0;
    if (SDL_LockTexture(texture_.get(), nullptr, &pixels, &pitch_bytes) != 0) return failed("the picture cannot be changed");
    for (int y = 0; y < height_; ++y) {
      auto* to =
          reinterpret_cast<std::uint32_t*>(static_cast<std::byte*>(pixels) + static_cast<std::ptrdiff_t>(y) * pitch_bytes);
      const auto* from = image.view().row<std::uint8_t>(y);
      for (int x = 0; x < width_; ++x) to[x] = 0xff000000U | 0x010101U * from[x];
    }
    SDL_UnlockTexture(texture_.get());
    return {};
  }
  void present() {
    SDL_RenderCopy(renderer_.get(), texture_.get(), nullptr, nullptr);
    SDL_RenderPresent(renderer_.get());
  }
  base::Result<base::Image> picture() {
    base::Image image(width_, height_, 8);
    std::vector<std::uint32_t> pixels(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
    SDL_RenderCopy(renderer_.get(), texture_.get(), nullptr, nullptr);
    if (SDL_RenderReadPixels(renderer_.get(), nullptr, SDL_PIXELFORMAT_ARGB8888, pixels.data(), width_ * 4) != 0)
      return failed("the picture cannot be read back");
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        const std::uint32_t colour =
            pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)];
        const std::uint32_t grey = colour & 0xffU;
        if ((colour & 0xffffffU) != 0x010101U * grey)
          return base::fail(ErrorCode::kDevice,
                            fmt::format("projector: the pixel ({}, {}) is not grey: {:#08x}", x, y, colour));
        image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(grey);
      }
    }
    return image;
  }

  /// Handles the desktop's events; why the window cannot be used any more, or nothing.
  std::string handle_events() {
    SDL_Event event;
    while (SDL_PollEvent(&event) != 0) {
      if (event.type == SDL_QUIT) return "the window was closed";
      if (event.type == SDL_DISPLAYEVENT && event.display.event == SDL_DISPLAYEVENT_DISCONNECTED &&
          static_cast<int>(event.display.display) == screen_)
        return "its screen was disconnected";
      if (event.type != SDL_WINDOWEVENT || event.window.windowID != SDL_GetWindowID(window_.get())) continue;
      switch (event.window.event) {
        case SDL_WINDOWEVENT_CLOSE:
          return "the window was closed";
        case SDL_WINDOWEVENT_HIDDEN:
        case SDL_WINDOWEVENT_MINIMIZED:
          // Making the renderer may hide the window and show it again: what it is now counts.
          if ((SDL_GetWindowFlags(window_.get()) & (SDL_WINDOW_HIDDEN | SDL_WINDOW_MINIMIZED)) != 0)
            return "the window was hidden";
          break;
        case SDL_WINDOWEVENT_SIZE_CHANGED: {
          int width = 0, height = 0;
          SDL_GetRendererOutputSize(renderer_.get(), &width, &height);
          if (width != width_ || height != height_)
            return fmt::format("the window has {} x {} px now, not {} x {}", width, height, width_, height_);
          break;
        }
        case SDL_WINDOWEVENT_EXPOSED:
          present();
          break;
        default:
          break;
      }
    }
    return {};
  }

 private:
  ShownWindow() = default;

  int screen_ = 0;
  int width_ = 0;
  int height_ = 0;
  Window window_;
  Renderer renderer_;  ///< after the window, before which it ends
  Texture texture_;
};

std::atomic<bool> one_is_alive = false;

class SdlSequencer : public WindowSequencer {
 public:
  SdlSequencer(const WindowSequencerOptions& options, std::shared_ptr<SdlThread> thread)
      : options_(options), thread_(std::move(thread)) {
    thread_->set_idle([this] { look_after(); });
  }
  SdlSequencer(const SdlSequencer&) = delete;
  SdlSequencer& operator=(const SdlSequencer&) = delete;
  ~SdlSequencer() override {
    close();
    thread_->set_idle({});
    thread_.reset();
    one_is_alive = false;
  }

  base::Result<base::Image> picture() override {
    base::Result<base::Image> image = base::fail(ErrorCode::kDevice, "projector: no window is open");
    thread_->run([&] {
      look_after();
      image = window_ ? window_->picture() : lost();
    });
    return image;
  }
  void close() override {
    thread_->run([this] {
      window_.reset();
      why_not_ = "the window is closed";
    });
  }

 protected:
  base::Result<> store(const base::PatternSequence& sequence, const std::vector<base::Image>&) override {
    base::Result<> stored;
    thread_->run([&] { stored = open_for(sequence.width_px, sequence.height_px); });
    return stored;
  }
  base::Result<> show(std::size_t, const base::Pattern&, const base::Image& image) override {
    base::Result<> shown;
    thread_->run([&] { shown = present(image); });
    return shown;
  }

 private:
  // All of it on SDL's thread.
  [[nodiscard]] tl::unexpected<base::Error> lost() const {
    return base::fail(ErrorCode::kDevice, fmt::format("projector: {}; upload the patterns again", why_not_));
  }
  void look_after() {
    if (!window_) return SDL_PumpEvents();
    why_not_ = window_->handle_events();
    if (!why_not_.empty()) window_.reset();
  }
  base::Result<> open_for(int width_px, int height_px) {
    window_.reset();
    why_not_ = "no window could be opened";
    SDL_FlushEvents(SDL_FIRSTEVENT, SDL_LASTEVENT);  // those of a window before
    const auto screen = find_screen(options_.screen);
    if (!screen) return tl::unexpected(screen.error());
    if (screen->width_px != width_px || screen->height_px != height_px) {
      return base::fail(
          ErrorCode::kBadInput,
          fmt::format("projector: the patterns have {} x {} px, screen {} ({}) has {} x {} px; make patterns of the "
                      "screen's size, or set the screen to theirs",
                      width_px, height_px, screen->index, screen->name, screen->width_px, screen->height_px));
    }
    auto opened = ShownWindow::open(*screen);
    if (!opened) return base::fail(std::move(opened));
    window_ = *std::move(opened);
    period_ = to_nanoseconds(1.0 / (screen->refresh_hz > 0.0 ? screen->refresh_hz : options_.assumed_refresh_hz));
    look_after();
    return window_ ? base::Result<>{} : lost();
  }
  base::Result<> present(const base::Image& image) {
    look_after();
    if (!window_) return lost();
    if (auto drawn = window_->draw(image); !drawn) return drawn;
    window_->present();
    const HostTime presented = host_now();
    // With vertical synchronisation each one waits for a refresh; what it does not wait for, the clock does.
    for (int i = 0; i < options_.settle_refreshes; ++i) window_->present();
    std::this_thread::sleep_until(presented + options_.settle_refreshes * period_);
    look_after();
    return window_ ? base::Result<>{} : lost();
  }

  WindowSequencerOptions options_;
  std::shared_ptr<SdlThread> thread_;
  std::unique_ptr<ShownWindow> window_;
  std::string why_not_ = "no patterns were uploaded";  ///< there is no window
  std::chrono::nanoseconds period_{};                  ///< of the screen's refreshes
};

}  // namespace

base::Result<std::vector<Screen>> list_screens() {
  const auto thread = SdlThread::acquire();
  if (!thread) return tl::unexpected(thread.error());
  std::vector<Screen> screens;
  (*thread)->run([&] { screens = screens_now(); });
  return screens;
}

base::Result<> WindowSequencerOptions::validate() const {
  constexpr int kMostRefreshes = 600;
  if (screen < 0 || settle_refreshes < 0 || settle_refreshes > kMostRefreshes || !(assumed_refresh_hz >= 1.0) ||
      assumed_refresh_hz > 1000.0) {
    return base::fail(ErrorCode::kUsage,
                      fmt::format("projector: screen {}, {} refreshes to settle (0 to {}), {} Hz (1 to 1000)", screen,
                                  settle_refreshes, kMostRefreshes, assumed_refresh_hz));
  }
  return {};
}

base::Result<std::unique_ptr<WindowSequencer>> WindowSequencer::open(const WindowSequencerOptions& options) {
  if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
  auto thread = SdlThread::acquire();
  if (!thread) return base::fail(std::move(thread));
  base::Result<Screen> screen;
  (*thread)->run([&] { screen = find_screen(options.screen); });
  if (!screen) return base::fail(std::move(screen));
  if (one_is_alive.exchange(true)) return base::fail(ErrorCode::kUsage, "projector: a window shows patterns already");
  return std::make_unique<SdlSequencer>(options, *std::move(thread));
}

}  // namespace crosstie::devices
