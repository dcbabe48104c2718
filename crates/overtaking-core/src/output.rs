//! Where recorded numbers go.

/// Decisions of the ego that are written down for a simulation.
pub const MAX_PERCEPTS: usize = 4;

/// A struct of output slices that can be cut into simulations.
macro_rules! output_fields {
    ($($(#[$doc:meta])* $field:ident: $kind:ty, $size:expr;)*) => {
        /// Where recorded numbers go; each slice leads with the simulation.
        pub struct Output<'a> {
            $($(#[$doc])* pub $field: &'a mut [$kind],)*
            /// Frames that there is room for, a multiple of sixteen.
            pub frames: usize,
            /// Vehicle slots of a simulation.
            pub slots: usize,
        }

        /// Memory of its own for outputs, where nobody has given any.
        pub(crate) struct Storage {
            $($field: Vec<$kind>,)*
            frames: usize,
            slots: usize,
        }

        impl Storage {
            /// Room for the outputs of a batch.
            pub(crate) fn new(batch: usize, slots: usize, frames: usize) -> Self {
                Self { $($field: vec![0; batch * $size(slots, frames)],)* frames, slots }
            }

            /// Outputs into it.
            pub(crate) fn output(&mut self) -> Output<'_> {
                Output {
                    $($field: &mut self.$field,)*
                    frames: self.frames,
                    slots: self.slots,
                }
            }
        }

        impl<'a> Output<'a> {
            /// Length that each slice must have for `batch` simulations, by name.
            pub fn sizes(batch: usize, slots: usize, frames: usize) -> Vec<(&'static str, usize)> {
                vec![$((stringify!($field), batch * $size(slots, frames))),*]
            }

            /// One output for each simulation.
            pub(crate) fn into_simulations(self) -> Vec<Output<'a>> {
                let (slots, frames) = (self.slots, self.frames);
                let count = self.num_frames.len();
                $(let mut $field = self.$field.chunks_mut($size(slots, frames).max(1));)*
                let next = |_| Some(Output { $($field: $field.next()?,)* slots, frames });
                (0..count).map(next).collect::<Option<Vec<_>>>().unwrap_or_default()
            }
        }
    };
}

output_fields! {
    /// Recorded frames.
    num_frames: i32, |_, _| 1;
    /// Up to which frame the states of a vehicle may hold something; behind it they are zero.
    written: i32, |v, _| v;
    /// OpenDRIVE x [mm].
    x: i32, |v, t| v * t;
    /// OpenDRIVE y [mm].
    y: i32, |v, t| v * t;
    /// Position along the road [mm].
    s: i32, |v, t| v * t;
    /// Lateral position [mm].
    d: i32, |v, t| v * t;
    /// Speed [mm/s].
    speed: i32, |v, t| v * t;
    /// World heading [0.1 mrad].
    heading: i16, |v, t| v * t;
    /// Front wheel angle [0.1 mrad].
    wheel_angle: i16, |v, t| v * t;
    /// Longitudinal acceleration [mm/s^2].
    accel_lon: i16, |v, t| v * t;
    /// Lateral acceleration [mm/s^2].
    accel_lat: i16, |v, t| v * t;
    /// Yaw rate [0.1 mrad/s].
    yaw_rate: i16, |v, t| v * t;
    /// Lane index.
    lane: u8, |v, t| v * t;
    /// Bits of lights.
    lights: u8, |v, t| v * t;
    /// Stage of the ego.
    stage: u8, |_, t| t;
    /// Slot that the ego has collided with.
    collided_with: u8, |_, t| t;
    /// First collision of each vehicle: partner.
    contact_partner: u8, |v, _| v;
    /// Its instant [ms].
    contact_time: i32, |v, _| v;
    /// Its impulse [N s].
    contact_impulse: i32, |v, _| v;
    /// Its closing speed [mm/s].
    contact_speed: i32, |v, _| v;
    /// Whether a percept is there.
    percept_valid: u8, |_, _| MAX_PERCEPTS;
    /// Its decision.
    percept_kind: u8, |_, _| MAX_PERCEPTS;
    /// Its instant [ms].
    percept_time: i32, |_, _| MAX_PERCEPTS;
    /// The neighbours.
    percept_vehicle: u8, |_, _| MAX_PERCEPTS * 3;
    /// Whether they were noticed.
    percept_detected: u8, |_, _| MAX_PERCEPTS * 3;
    /// Believed gaps [mm].
    percept_gap: i32, |_, _| MAX_PERCEPTS * 3;
    /// Believed closing speeds [mm/s].
    percept_closing_speed: i32, |_, _| MAX_PERCEPTS * 3;
    /// True gaps [mm].
    percept_true_gap: i32, |_, _| MAX_PERCEPTS * 3;
    /// True closing speeds [mm/s].
    percept_true_closing_speed: i32, |_, _| MAX_PERCEPTS * 3;
    /// Hash over everything recorded.
    trace_hash: u32, |_, _| 4;
}
