//! The camera in the user's hands: turning about a point, and flying.

use glam::{Quat, Vec3};
use std::f32::consts::PI;
use tracer::scene::View;

/// How the camera answers to arrows and the mouse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// About the point that is looked at.
    #[default]
    Orbit,
    /// Through the scene.
    Fly,
}

/// A way to go, of which several may be held at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    Forward,
    Back,
    Left,
    Right,
    Up,
    Down,
}

/// Where the camera is and what it looks at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    eye: Vec3,
    target: Vec3,
    up: Vec3,
    vfov_degrees: f32,
}

/// Turns a second while an arrow is held.
const TURN: f32 = PI / 3.0;
/// Share of the scene's diagonal that is flown through in a second.
const SPEED: f32 = 0.12;
/// By what the distance changes in a second, and with each step of the wheel.
const APPROACH: f32 = 2.0;
const WHEEL: f32 = 1.1;
/// A picture's height of mouse movement turns so far.
const DRAG: f32 = PI;
/// How near to straight up or down one can look.
const STEEPEST: f32 = 0.49 * PI;

impl Pose {
    /// That of a view.
    pub fn of(view: &View) -> Self {
        Self {
            eye: Vec3::from_array(view.eye),
            target: Vec3::from_array(view.target),
            up: Vec3::from_array(view.up).normalize_or(Vec3::Y),
            vfov_degrees: view.vfov_degrees,
        }
    }

    /// As a view of that name.
    pub fn view(&self, name: &str) -> View {
        View {
            name: name.into(),
            eye: self.eye.to_array(),
            target: self.target.to_array(),
            up: self.up.to_array(),
            vfov_degrees: self.vfov_degrees,
        }
    }

    fn turned(&self, along: Vec3, yaw: f32, pitch: f32) -> Vec3 {
        let length = along.length();
        let forward = along.normalize_or(Vec3::NEG_Z);
        let right = forward.cross(self.up).try_normalize();
        let right = right.unwrap_or_else(|| self.up.any_orthonormal_vector());
        // The elevation stays short of the poles, where left and right would change places.
        let elevation = forward.dot(self.up).clamp(-1.0, 1.0).asin();
        let pitch = (elevation + pitch).clamp(-STEEPEST, STEEPEST) - elevation;
        let turned = Quat::from_axis_angle(self.up, yaw) * (Quat::from_axis_angle(right, pitch) * forward);
        turned.normalize() * length
    }

    /// Goes about the point that is looked at, to the right and upwards, in radians.
    pub fn orbit(&mut self, right: f32, up: f32) {
        // What is looked along turns the other way: from higher up one looks down.
        let along = self.turned(self.target - self.eye, right, -up);
        self.eye = self.target - along;
    }

    /// Looks further to the right and up, in radians, from where it is.
    pub fn look(&mut self, right: f32, up: f32) {
        self.target = self.eye + self.turned(self.target - self.eye, -right, up);
    }

    /// Goes nearer to the point that is looked at: a `factor` of 2 halves the distance.
    pub fn approach(&mut self, factor: f32) {
        let away = (self.eye - self.target) / factor;
        // Closer than numbers can tell apart there would be no direction left.
        if away.length() > 1e-5 * (1.0 + self.target.abs().max_element()) {
            self.eye = self.target + away;
        }
    }

    /// Goes through the scene with what is looked at: units forward, to the right and up.
    pub fn fly(&mut self, forward: f32, right: f32, up: f32) {
        let ahead = (self.target - self.eye).normalize_or(Vec3::NEG_Z);
        let aside = ahead.cross(self.up).normalize_or(self.up.any_orthonormal_vector());
        let way = ahead * forward + aside * right + self.up * up;
        self.eye += way;
        self.target += way;
    }

    /// Moves for `seconds` in one direction through a scene of a size.
    pub fn go(&mut self, motion: Motion, direction: Direction, seconds: f32, diagonal: f32) {
        let (turn, way) = (TURN * seconds, SPEED * diagonal * seconds);
        match (motion, direction) {
            (Motion::Orbit, Direction::Left) => self.orbit(-turn, 0.0),
            (Motion::Orbit, Direction::Right) => self.orbit(turn, 0.0),
            (Motion::Orbit, Direction::Forward) => self.orbit(0.0, turn),
            (Motion::Orbit, Direction::Back) => self.orbit(0.0, -turn),
            (Motion::Orbit, Direction::Up) => self.approach(APPROACH.powf(seconds)),
            (Motion::Orbit, Direction::Down) => self.approach(APPROACH.powf(-seconds)),
            (Motion::Fly, Direction::Forward) => self.fly(way, 0.0, 0.0),
            (Motion::Fly, Direction::Back) => self.fly(-way, 0.0, 0.0),
            (Motion::Fly, Direction::Left) => self.fly(0.0, -way, 0.0),
            (Motion::Fly, Direction::Right) => self.fly(0.0, way, 0.0),
            (Motion::Fly, Direction::Up) => self.fly(0.0, 0.0, way),
            (Motion::Fly, Direction::Down) => self.fly(0.0, 0.0, -way),
        }
    }

    /// Follows the mouse, which was dragged by these shares of the picture's height, right and down.
    pub fn drag(&mut self, motion: Motion, right: f32, down: f32) {
        match motion {
            // The scene is dragged along.
            Motion::Orbit => self.orbit(-DRAG * right, DRAG * down),
            // The eye goes where the mouse goes, half as fast.
            Motion::Fly => self.look(0.5 * DRAG * right, -0.5 * DRAG * down),
        }
    }

    /// Follows the mouse wheel, which went so many steps away from the user.
    pub fn wheel(&mut self, motion: Motion, steps: f32, diagonal: f32) {
        match motion {
            Motion::Orbit => self.approach(WHEEL.powf(steps)),
            Motion::Fly => self.fly(0.1 * SPEED * diagonal * steps, 0.0, 0.0),
        }
    }
}

/// Which directions are held. One that was let go before anybody looked counts once, so that a tap between two frames is
/// not lost.
#[derive(Debug, Default)]
pub struct Held {
    held: Vec<Direction>,
    tapped: Vec<Direction>,
}

impl Held {
    /// A key went down.
    pub fn press(&mut self, direction: Direction) {
        if !self.held.contains(&direction) {
            self.held.push(direction);
            self.tapped.push(direction);
        }
    }

    /// A key went up.
    pub fn release(&mut self, direction: Direction) {
        self.held.retain(|held| *held != direction);
    }

    /// All keys went up, as far as the window can tell.
    pub fn release_all(&mut self) {
        self.held.clear();
    }

    /// The directions to go in for a frame.
    pub fn take(&mut self) -> Vec<Direction> {
        let mut all = std::mem::take(&mut self.tapped);
        all.extend(self.held.iter().filter(|held| !all.contains(held)).copied().collect::<Vec<_>>());
        all
    }

    /// Whether there is somewhere to go.
    pub fn any(&self) -> bool {
        !self.held.is_empty() || !self.tapped.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose() -> Pose {
        let view = View {
            name: "v".into(),
            eye: [0.0, 1.0, 5.0],
            target: [0.0, 1.0, 0.0],
            up: [0.0, 2.0, 0.0],
            vfov_degrees: 50.0,
        };
        Pose::of(&view)
    }

    #[track_caller]
    fn close(found: Vec3, expected: [f32; 3]) {
        assert!((found - Vec3::from_array(expected)).length() < 1e-4, "{found} is not {expected:?}");
    }

    #[test]
    fn a_view_survives_a_pose() {
        let pose = pose();
        assert_eq!(Pose::of(&pose.view("x")), pose);
        assert_eq!(pose.view("x").name, "x");
    }

    #[test]
    fn orbiting_keeps_the_distance_and_what_is_looked_at() {
        let mut it = pose();
        it.orbit(PI / 2.0, 0.0);
        close(it.eye, [5.0, 1.0, 0.0]);
        close(it.target, [0.0, 1.0, 0.0]);
        it.orbit(0.0, PI / 6.0);
        close(it.eye, [5.0 * (PI / 6.0).cos(), 3.5, 0.0]);
        for step in 0..1000 {
            it.orbit(0.7, if step % 3 == 0 { 0.4 } else { -0.3 });
        }
        assert!(((it.eye - it.target).length() - 5.0).abs() < 1e-3);
        close(it.target, [0.0, 1.0, 0.0]);
    }

    #[test]
    fn nothing_tips_over_the_poles() {
        let mut it = pose();
        for _ in 0..10 {
            it.orbit(0.0, 1.0);
        }
        assert!(it.eye.y > 5.9 && it.eye.z > 0.0, "{}", it.eye);
        for _ in 0..10 {
            it.look(0.0, -1.0);
            assert!((it.target - it.eye).is_finite());
        }
        // A view straight down can be turned as well.
        let mut down = Pose::of(&View { target: [0.0, -3.0, 5.0], ..pose().view("down") });
        down.orbit(0.3, -0.5);
        assert!(down.eye.is_finite() && (down.eye - down.target).length() > 3.9);
    }

    #[test]
    fn looking_keeps_the_place() {
        let mut it = pose();
        it.look(PI / 2.0, 0.0);
        close(it.eye, [0.0, 1.0, 5.0]);
        close(it.target, [5.0, 1.0, 5.0]);
        it.look(0.0, 0.2);
        assert!(it.target.y > 1.9 && (it.target - it.eye).length() > 4.99);
    }

    #[test]
    fn flying_takes_the_target_along() {
        let mut it = pose();
        it.go(Motion::Fly, Direction::Forward, 1.0, 10.0);
        close(it.eye, [0.0, 1.0, 5.0 - 10.0 * SPEED]);
        close(it.target, [0.0, 1.0, -10.0 * SPEED]);
        it.go(Motion::Fly, Direction::Back, 1.0, 10.0);
        it.go(Motion::Fly, Direction::Right, 2.0, 10.0);
        close(it.eye, [20.0 * SPEED, 1.0, 5.0]);
        it.go(Motion::Fly, Direction::Left, 2.0, 10.0);
        it.go(Motion::Fly, Direction::Up, 1.0, 10.0);
        close(it.eye, [0.0, 1.0 + 10.0 * SPEED, 5.0]);
        it.go(Motion::Fly, Direction::Down, 1.0, 10.0);
        close(it.eye, [0.0, 1.0, 5.0]);
    }

    #[test]
    fn approaching_halves_the_distance_and_never_arrives() {
        let mut it = pose();
        it.approach(2.0);
        close(it.eye, [0.0, 1.0, 2.5]);
        it.go(Motion::Orbit, Direction::Down, 1.0, 1.0);
        close(it.eye, [0.0, 1.0, 5.0]);
        it.wheel(Motion::Orbit, 1.0, 1.0);
        close(it.eye, [0.0, 1.0, 5.0 / WHEEL]);
        for _ in 0..200 {
            it.approach(2.0);
        }
        assert!((it.eye - it.target).length() > 0.0);
    }

    #[test]
    fn the_mouse_drags_the_scene_or_turns_the_head() {
        let mut it = pose();
        it.drag(Motion::Orbit, 0.1, 0.0);
        assert!(it.eye.x < 0.0, "dragged to the right, more of the left is seen: {}", it.eye);
        it.drag(Motion::Orbit, 0.0, 0.1);
        assert!(it.eye.y > 1.0, "dragged down, more of the top is seen: {}", it.eye);
        let mut it = pose();
        it.drag(Motion::Fly, 0.1, 0.1);
        assert!(it.target.x > 0.0 && it.target.y < 1.0, "{}", it.target);
        close(it.eye, [0.0, 1.0, 5.0]);
    }

    #[test]
    fn a_tap_between_two_frames_counts_once() {
        let mut held = Held::default();
        held.press(Direction::Left);
        held.release(Direction::Left);
        assert!(held.any());
        assert_eq!(held.take(), [Direction::Left]);
        assert!(!held.any() && held.take().is_empty());
        held.press(Direction::Up);
        // Keys repeat while they are held.
        held.press(Direction::Up);
        assert_eq!(held.take(), [Direction::Up]);
        assert_eq!(held.take(), [Direction::Up]);
        held.release_all();
        assert!(held.take().is_empty());
    }
}
