//! The window, and what happens in it.

use super::{
    benchmark::Benchmark,
    camera::{Held, Motion, Pose},
    chart::{self, Entry, FAINT, History, INK, PANEL},
    draw::{self, Area},
    keys::{self, Action, Step},
    stage::{self, HEAT_MAPS, Shot, Shown, Stage},
};
use crate::{
    args::Heatmap,
    picture::{Picture, Scale, heat},
    progress::remark,
    session::interrupted,
    variant::Variant,
};
use anyhow::Context;
use record::Record;
use std::{
    fmt,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};
use tracer::{
    gpu::Presenter,
    path::Integrator,
    scene::{self, SearchPath, View},
};
use winit::{
    application::ApplicationHandler,
    dpi::PhysicalSize,
    event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent},
    event_loop::{ActiveEventLoop, ControlFlow},
    keyboard::ModifiersState,
    window::{Window, WindowId},
};

/// Samples are traced for so long before they are shown together, unless the camera moves.
const BETWEEN_FRAMES: Duration = Duration::from_millis(33);
/// So many samples are enough to look at; after them the device rests.
const ENOUGH: u32 = 4096;
/// What happened is told for so long.
const NOTED: Duration = Duration::from_secs(6);
/// The camera moves for at most so long in a frame, however long that took.
const LONGEST_STEP: f32 = 0.15;
/// And for so long at least, so that a tap moves it.
const SHORTEST_STEP: f32 = 1.0 / 60.0;
/// Radians a second when it turns by itself.
const TURNTABLE: f32 = 0.4;
/// How much faster with Shift.
const FAST: f32 = 4.0;
const MOST_DEPTH: u32 = 64;

/// What stays as it is while the window is open.
pub struct Setting<'a> {
    /// Nothing on stderr.
    pub quiet: bool,
    /// What the user called the scene.
    pub spec: &'a str,
    /// Where scenes are found.
    pub search: &'a SearchPath,
    /// Where a built-in scene gets its own descriptor.
    pub own_scenes: &'a Path,
    /// Where pictures go.
    pub pictures: &'a Path,
    /// Pixels of the window along each side of a pixel of the picture.
    pub zoom: u32,
    /// From corner to corner of the scene.
    pub diagonal: f32,
}

/// Somebody who looks around.
pub struct Looker<'a> {
    setting: Setting<'a>,
    stage: Stage<'a>,
    scene: String,
    views: Vec<View>,
    /// The view chosen last.
    view: usize,
    pose: Pose,
    motion: Motion,
    turning: bool,
    held: Held,
    modifiers: ModifiersState,
    /// Where the mouse is, and whether it drags.
    mouse: Option<(f64, f64)>,
    dragging: bool,
    variants: Vec<Variant>,
    size: (u32, u32),
    depth: u32,
    exposure: f32,
    integrator: Integrator,
    heatmap: Option<Heatmap>,
    history: History,
    overlay: bool,
    help: bool,
    note: Option<(String, Instant)>,
    /// Whether to save the next frame: what keys before it have asked for is not there yet.
    saving: bool,
    benchmark: Option<Benchmark>,
    last_frame: Instant,
    presenter: Option<Presenter>,
    window: Option<Arc<Window>>,
    title: String,
    failed: Option<anyhow::Error>,
}

impl<'a> Looker<'a> {
    /// In front of a stage, at one of the scene's views.
    pub fn new(
        setting: Setting<'a>,
        stage: Stage<'a>,
        (scene, views, view): (String, Vec<View>, usize),
        variants: Vec<Variant>,
        (size, depth, exposure): ((u32, u32), u32, f32),
        (integrator, heatmap): (Integrator, Option<Heatmap>),
        benchmark: Option<Benchmark>,
    ) -> Self {
        Self {
            setting,
            stage,
            scene,
            pose: Pose::of(&views[view]),
            views,
            view,
            motion: Motion::default(),
            turning: false,
            held: Held::default(),
            modifiers: ModifiersState::empty(),
            mouse: None,
            dragging: false,
            variants,
            size,
            depth,
            exposure,
            integrator,
            heatmap,
            history: History::default(),
            overlay: true,
            help: false,
            note: None,
            saving: false,
            benchmark,
            last_frame: Instant::now(),
            presenter: None,
            window: None,
            title: String::new(),
            failed: None,
        }
    }

    /// What pixels show.
    fn shown(&self) -> Shown {
        self.heatmap.map_or(Shown::Light(self.integrator), Shown::Cost)
    }

    /// Whether the picture is one that the variant has not.
    pub fn is_blind(&self) -> bool {
        self.stage.variant().is_driver() && self.heatmap.is_some()
    }

    /// What came of it: the record, where there was a benchmark.
    ///
    /// # Errors
    /// Whatever made the window close.
    pub fn finish(self) -> anyhow::Result<Option<Record>> {
        match (self.failed, self.benchmark) {
            (Some(error), _) => Err(error),
            (None, None) => Ok(None),
            (None, Some(benchmark)) => {
                Ok(Some(benchmark.finish().context("the window was closed before anything was measured")?))
            }
        }
    }

    fn open(&mut self, events: &ActiveEventLoop) -> anyhow::Result<()> {
        let zoom = self.setting.zoom;
        let size = PhysicalSize::new(self.size.0 * zoom, self.size.1 * zoom);
        let attributes = Window::default_attributes().with_title("runner").with_inner_size(size);
        let window = Arc::new(events.create_window(attributes).context("no window can be opened")?);
        let size = window.inner_size();
        self.presenter = Some(Presenter::new(self.stage.gpu(), window.clone(), (size.width, size.height))?);
        self.window = Some(window);
        Ok(())
    }

    /// Says something in the window and on stderr.
    fn note(&mut self, text: impl fmt::Display) {
        remark(self.setting.quiet, format_args!("{text}"));
        self.note = Some((text.to_string(), Instant::now()));
    }

    /// The scene's view that the camera stands at, if it has not moved from it.
    fn at_view(&self) -> Option<&View> {
        let stands = |view: &&View| Pose::of(view) == self.pose;
        // Of equal ones, the one that was chosen.
        self.views.get(self.view).filter(stands).or_else(|| self.views.iter().find(stands))
    }

    fn act(&mut self, action: Action, events: &ActiveEventLoop) {
        match action {
            Action::Go(direction) => self.held.press(direction),
            Action::Orbit => self.motion = Motion::Orbit,
            Action::Fly => self.motion = Motion::Fly,
            Action::Turn => self.turning = !self.turning,
            Action::View(view) if view < self.views.len() => self.go_to(view),
            Action::View(view) => self.note(format_args!("there is no view {}", view + 1)),
            Action::NextView(step) => self.go_to(step.around(self.view, self.views.len())),
            Action::Reset => self.go_to(self.view),
            Action::NextVariant(step) => self.next_variant(step),
            Action::Depth(_) if self.benchmark.is_some() => {
                self.note("the length of paths stays as it is while a benchmark runs");
            }
            Action::Depth(Step::On) => self.depth = (self.depth + 1).min(MOST_DEPTH),
            Action::Depth(Step::Back) => self.depth = (self.depth - 1).max(1),
            Action::Integrator if self.benchmark.is_some() => {
                self.note("how light is found stays as it is while a benchmark runs");
            }
            Action::Integrator => {
                self.integrator = match self.integrator {
                    Integrator::Path => Integrator::Phong,
                    Integrator::Phong => Integrator::Path,
                };
            }
            Action::HeatMap(_) if self.stage.variant().is_driver() => {
                self.note("the driver does not tell what rays meet in its tree");
            }
            Action::HeatMap(step) => {
                let now = HEAT_MAPS.iter().position(|heatmap| *heatmap == self.heatmap).unwrap_or(0);
                self.heatmap = HEAT_MAPS[step.around(now, HEAT_MAPS.len())];
            }
            Action::Exposure(Step::On) => self.exposure += 0.5,
            Action::Exposure(Step::Back) => self.exposure -= 0.5,
            Action::Save => self.saving = true,
            Action::Chart => self.overlay = !self.overlay,
            Action::Help => self.help = !self.help,
            Action::Quit => events.exit(),
        }
    }

    fn go_to(&mut self, view: usize) {
        self.view = view;
        self.pose = Pose::of(&self.views[view]);
        self.turning = false;
    }

    fn next_variant(&mut self, step: Step) {
        let now = self.variants.iter().position(|variant| *variant == self.stage.variant()).unwrap_or(0);
        let next = self.variants[step.around(now, self.variants.len())];
        if next == self.stage.variant() {
            return self.note("there is no other variant: --variant names those that there are");
        }
        match self.stage.cast(next) {
            Ok(()) => {
                self.history.clear();
                if self.is_blind() {
                    self.heatmap = None;
                    self.note("the driver does not tell what rays meet in its tree");
                }
            }
            Err(error) => self.note(format_args!("{next} cannot be shown: {error:#}")),
        }
    }

    /// Writes the picture, and the view into the scene's file where it is a new one.
    fn save(&mut self) -> anyhow::Result<String> {
        let known = self.at_view().cloned();
        let pictures = self.setting.pictures;
        let path = |name: &str| pictures.join(file_name(&self.scene, name));
        let (view, picture) = match &known {
            Some(view) => (view.clone(), unused(|n| path(&numbered(&view.name, n)), |path| !path.exists())),
            None => {
                let name = unused(
                    |n| format!("saved_{}", n + 1),
                    |name| self.views.iter().all(|view| view.name != *name) && !path(name).exists(),
                );
                (self.pose.view(&name), path(&name))
            }
        };
        self.stage.picture_to_keep(self.shown(), self.exposure)?.write(&picture)?;
        let picture = picture.display();
        if known.is_some() {
            return Ok(format!("picture: {picture}; the view {:?} is the scene's already", view.name));
        }
        let Setting { spec, search, own_scenes, .. } = self.setting;
        let file = scene::keep_view(spec, search, own_scenes, &self.views, &view)
            .with_context(|| format!("picture: {picture}; but the view is not kept"))?;
        let said = format!("picture: {picture}; view {:?}: {}", view.name, file.display());
        self.views.push(view);
        self.view = self.views.len() - 1;
        Ok(said)
    }

    /// Whether there is anything to trace.
    fn is_busy(&self) -> bool {
        self.saving
            || self.held.any()
            || self.turning
            || self.benchmark.is_some()
            || self.stage.samples() < ENOUGH
    }

    /// Moves the camera for the time since the last frame; whether it did.
    fn move_camera(&mut self) -> bool {
        let taken = self.last_frame.elapsed().as_secs_f32().clamp(SHORTEST_STEP, LONGEST_STEP);
        self.last_frame = Instant::now();
        let before = self.pose;
        let seconds = if self.modifiers.shift_key() { FAST * taken } else { taken };
        for direction in self.held.take() {
            self.pose.go(self.motion, direction, seconds, self.setting.diagonal);
        }
        if self.turning {
            self.pose.orbit(TURNTABLE * taken, 0.0);
        }
        self.pose != before
    }

    fn frame(&mut self, events: &ActiveEventLoop) -> anyhow::Result<()> {
        let Some(size) = self.presenter.as_mut().map(Presenter::frame).transpose()?.flatten() else {
            return Ok(());
        };
        let began = Instant::now();
        let moving = self.move_camera() || self.dragging;
        let shot = Shot {
            pose: self.pose,
            size: self.size,
            depth: self.depth,
            variant: self.stage.variant(),
            shown: self.shown(),
        };
        loop {
            if let Some(sample) = self.stage.frame(&shot, moving)? {
                if let Some(entry) = Entry::of(&sample) {
                    self.history.add(entry);
                }
                let view = self.at_view().map(|view| view.name.clone());
                if let Some(benchmark) = &mut self.benchmark {
                    benchmark.add(&mut self.stage, (view.as_deref(), shot.pose), &sample)?;
                    if benchmark.over().is_some() {
                        events.exit();
                        return Ok(());
                    }
                }
            }
            // What a record has to know is counted by rays that leave light in the picture.
            if self.stage.is_spoilt() {
                continue;
            }
            if moving || interrupted() || began.elapsed() >= BETWEEN_FRAMES || !self.is_busy() {
                break;
            }
        }
        if std::mem::take(&mut self.saving) {
            match self.save() {
                Ok(said) => self.note(said),
                Err(error) => self.note(format_args!("not saved: {error:#}")),
            }
        }
        self.set_title();
        let frame = self.composed(size)?;
        if let Some(presenter) = &mut self.presenter {
            presenter.show(&frame.pixels)?;
        }
        Ok(())
    }

    /// What is seen, in the title of the window.
    fn set_title(&mut self) {
        let [view, variant, what] = self.in_words();
        let title = format!("{}, {view}, {variant}, {what} – runner", self.scene);
        if let Some(window) = self.window.as_ref().filter(|_| title != self.title) {
            window.set_title(&title);
            self.title = title;
        }
    }

    /// The view, the variant, and what pixels show.
    fn in_words(&self) -> [String; 3] {
        let what = match self.shown() {
            Shown::Light(integrator) => format!("{}, depth {}", stage::name(integrator), self.depth),
            Shown::Cost(heatmap) => format!("{heatmap:?} of a primary ray").to_lowercase(),
        };
        let view = self.at_view().map_or("moved", |view| view.name.as_str());
        [view.into(), self.stage.variant().to_string(), what]
    }

    /// The frame: the picture, and what is drawn over it.
    fn composed(&self, (width, height): (u32, u32)) -> anyhow::Result<Picture> {
        let (width, height) = (width as usize, height as usize);
        let (picture, scale) = self.stage.picture(self.shown(), self.exposure)?;
        let mut frame = Picture { width, height, pixels: vec![[0; 3]; width * height] };
        draw::place(&mut frame, &picture);
        let factor = self.window.as_ref().map_or(1.0, |window| window.scale_factor()) as f32;
        let size = (14.0 * factor).min(height as f32 / 14.0).max(9.0);
        if self.overlay {
            self.draw_words(&mut frame, size, scale.as_ref());
            chart::draw(&mut frame, &self.history, size);
        }
        if self.help {
            draw_help(&mut frame, size);
        }
        Ok(frame)
    }

    fn draw_words(&self, frame: &mut Picture, size: f32, scale: Option<&Scale>) {
        let [view, variant, what] = self.in_words();
        let motion = match self.motion {
            Motion::Orbit => "orbit",
            Motion::Fly => "fly",
        };
        let samples = self.stage.samples();
        let mut lines = vec![
            (INK, format!("{}   {view}   {variant}", self.scene)),
            (
                FAINT,
                format!(
                    "{what}   {samples} {}   {}×{}   {motion}",
                    if samples == 1 { "sample" } else { "samples" },
                    self.size.0,
                    self.size.1
                ),
            ),
        ];
        if let Some(benchmark) = &self.benchmark {
            lines.push((INK, benchmark.progress()));
        }
        if let Some((text, _)) = self.note.as_ref().filter(|(_, since)| since.elapsed() < NOTED) {
            lines.push((INK, text.clone()));
        }
        lines.push((FAINT, "F1 for keys".into()));
        if self.help {
            lines.pop();
        }
        let (unit, height) = (size as i32, draw::line_height(size));
        let width = lines.iter().map(|(_, text)| draw::text_width(size, text)).max().unwrap_or(0);
        // The legend of a heat map: its colours, from nothing to the end of the scale.
        let legend = if scale.is_some() { height + unit / 2 } else { 0 };
        let panel = Area {
            left: unit / 2,
            top: unit / 2,
            width: width.max(16 * unit) + unit,
            height: height * lines.len() as i32 + legend + unit,
        };
        draw::fill(frame, panel, PANEL);
        let mut inside = panel.within(unit / 2);
        for (paint, text) in &lines {
            draw::text(frame, inside.left, inside.top, size, *paint, text);
            inside.top += height;
        }
        if let Some(scale) = scale {
            let end = format!("{}", scale.upper);
            let zero = draw::text_width(size, "0") + unit / 2;
            let bar = 12 * unit;
            let top = inside.top + unit / 4;
            draw::text(frame, inside.left, top, size, FAINT, "0");
            for x in 0..bar {
                let area = Area { left: inside.left + zero + x, top, width: 1, height };
                draw::fill(frame, area, draw::Paint(heat(x as f32 / (bar - 1) as f32), 1.0));
            }
            draw::text(frame, inside.left + zero + bar + unit / 2, top, size, FAINT, &end);
        }
    }

    fn event(&mut self, events: &ActiveEventLoop, event: WindowEvent) -> anyhow::Result<()> {
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::Resized(size) => {
                if let Some(presenter) = &mut self.presenter {
                    presenter.resize((size.width, size.height));
                }
                // A benchmark has pictures of one size; the window shows as much of them as it can.
                if self.benchmark.is_none() && size.width > 0 && size.height > 0 {
                    let side = |window: u32| (window / self.setting.zoom).clamp(1, 32768);
                    self.size = (side(size.width), side(size.height));
                }
            }
            WindowEvent::ModifiersChanged(modifiers) => self.modifiers = modifiers.state(),
            WindowEvent::Focused(false) => {
                self.held.release_all();
                self.dragging = false;
            }
            WindowEvent::KeyboardInput { event: KeyEvent { logical_key, state, repeat, .. }, .. } => {
                match (keys::action(&logical_key, self.modifiers.shift_key()), state) {
                    (Some(Action::Go(direction)), ElementState::Released) => self.held.release(direction),
                    (Some(action), ElementState::Pressed) if !repeat => self.act(action, events),
                    _ => {}
                }
            }
            WindowEvent::MouseInput { state, button: MouseButton::Left, .. } => {
                self.dragging = state == ElementState::Pressed;
            }
            WindowEvent::CursorMoved { position, .. } => {
                let height = self.window.as_ref().map_or(1, |window| window.inner_size().height.max(1));
                if let (true, Some((x, y))) = (self.dragging, self.mouse) {
                    let share = |pixels: f64| (pixels / f64::from(height)) as f32;
                    self.pose.drag(self.motion, share(position.x - x), share(position.y - y));
                }
                self.mouse = Some((position.x, position.y));
            }
            WindowEvent::MouseWheel { delta, .. } => {
                let steps = match delta {
                    MouseScrollDelta::LineDelta(_, lines) => lines,
                    MouseScrollDelta::PixelDelta(pixels) => pixels.y as f32 / 40.0,
                };
                self.pose.wheel(self.motion, steps, self.setting.diagonal);
            }
            WindowEvent::RedrawRequested => return self.frame(events),
            _ => return Ok(()),
        }
        // What has changed is seen, whether there is anything to trace or not.
        if let Some(window) = &self.window {
            window.request_redraw();
        }
        Ok(())
    }

    fn check(&mut self, events: &ActiveEventLoop, result: anyhow::Result<()>) {
        if let Err(error) = result {
            self.failed.get_or_insert(error);
            events.exit();
        }
    }
}

impl ApplicationHandler for Looker<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.window.is_none() {
            let opened = self.open(events);
            self.check(events, opened);
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let done = self.event(events, event);
        self.check(events, done);
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        if interrupted() {
            return events.exit();
        }
        let Some(window) = &self.window else { return };
        if self.is_busy() {
            window.request_redraw();
            events.set_control_flow(ControlFlow::Poll);
        } else {
            if self.note.take_if(|(_, since)| since.elapsed() >= NOTED).is_some() {
                window.request_redraw();
            }
            // Now and then somebody has to look whether Ctrl-C was pressed, or a note is old.
            let soon = Instant::now() + Duration::from_millis(250);
            events.set_control_flow(ControlFlow::WaitUntil(soon));
        }
    }
}

/// The keys and what they do, in the middle of the frame.
fn draw_help(frame: &mut Picture, size: f32) {
    let size = size.min(frame.width as f32 / 48.0).max(7.0);
    let (unit, height) = (size as i32, draw::line_height(size));
    let column = |text: fn(&(&'static str, &'static str)) -> &'static str| {
        keys::TABLE.iter().map(|row| draw::text_width(size, text(row))).max().unwrap_or(0)
    };
    let (first, second) = (column(|row| row.0), column(|row| row.1));
    let (width, tall) = (first + second + 3 * unit, height * keys::TABLE.len() as i32 + unit);
    let middle = |of: usize, length: i32| (of as i32 - length) / 2;
    let panel =
        Area { left: middle(frame.width, width), top: middle(frame.height, tall), width, height: tall };
    draw::fill(frame, panel, draw::Paint(PANEL.0, 0.9));
    for (line, (key, does)) in keys::TABLE.iter().enumerate() {
        let top = panel.top + unit / 2 + line as i32 * height;
        draw::text(frame, panel.left + unit, top, size, INK, key);
        draw::text(frame, panel.left + first + 2 * unit, top, size, FAINT, does);
    }
}

/// The first of the candidates 0, 1, 2… that is free.
fn unused<T>(candidate: impl Fn(usize) -> T, is_free: impl Fn(&T) -> bool) -> T {
    (0..).map(candidate).find(is_free).expect("there is no end of numbers")
}

/// A name, from the second on with a number.
fn numbered(name: &str, n: usize) -> String {
    if n == 0 { name.to_owned() } else { format!("{name}-{}", n + 1) }
}

/// The file of a picture, by letters that every system takes.
fn file_name(scene: &str, view: &str) -> PathBuf {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    format!("{scene}-{view}.png").chars().map(plain).collect::<String>().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_get_names_that_are_free() {
        assert_eq!(file_name("city", "left corner/2"), PathBuf::from("city-left_corner_2.png"));
        let taken = ["a", "a-2"];
        assert_eq!(unused(|n| numbered("a", n), |name| !taken.contains(&name.as_str())), "a-3");
        assert_eq!(unused(|n| numbered("b", n), |name| !taken.contains(&name.as_str())), "b");
    }

    #[test]
    fn help_fits_a_small_window() {
        for (width, height) in [(320, 200), (1280, 720), (1, 1)] {
            let mut frame = Picture { width, height, pixels: vec![[128; 3]; width * height] };
            draw_help(&mut frame, 14.0);
            assert_ne!(frame.pixels[width / 2 + height / 2 * width], [128; 3]);
        }
    }
}
