//! Where recorded numbers go.

/// Decisions of the ego that are written down for a simulation.
pub const MAX_PERCEPTS: usize = 4;

/// Hand all outputs to a macro: behind what is given, those below with name, type and length for a number of
/// vehicles and frames; then the states (vehicle, frame).
#[macro_export]
macro_rules! with_outputs {
    ($then:ident! { $($given:tt)* }) => {
        $crate::with_states! { $then! {
            { $($given)* }
            {
                /// Recorded frames.
                num_frames: i32, |_, _| 1;
                /// Up to which frame the states of a vehicle may hold something; behind it they are zero.
                written: i32, |v, _| v;
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
                percept_valid: u8, |_, _| $crate::MAX_PERCEPTS;
                /// Its decision.
                percept_kind: u8, |_, _| $crate::MAX_PERCEPTS;
                /// Its instant [ms].
                percept_time: i32, |_, _| $crate::MAX_PERCEPTS;
                /// The neighbours.
                percept_slot: u8, |_, _| $crate::MAX_PERCEPTS * 3;
                /// Whether they were noticed.
                percept_is_detected: u8, |_, _| $crate::MAX_PERCEPTS * 3;
                /// Believed gaps [mm].
                percept_gap: i32, |_, _| $crate::MAX_PERCEPTS * 3;
                /// Believed closing speeds [mm/s].
                percept_closing_speed: i32, |_, _| $crate::MAX_PERCEPTS * 3;
                /// True gaps [mm].
                percept_true_gap: i32, |_, _| $crate::MAX_PERCEPTS * 3;
                /// True closing speeds [mm/s].
                percept_true_closing_speed: i32, |_, _| $crate::MAX_PERCEPTS * 3;
                /// Hash over everything recorded.
                trace_hash: u32, |_, _| 4;
            }
        } }
    };
}

/// A struct of output slices that can be cut into simulations.
macro_rules! output_fields {
    (
        { {} { $($(#[$doc:meta])* $field:ident: $kind:ty, $size:expr;)* } }
        $($(#[$meaning:meta])* $state:ident: $number:ty,)*
    ) => {
        /// Where recorded numbers go; each slice leads with the simulation.
        pub struct Output<'a> {
            $($(#[$doc])* pub $field: &'a mut [$kind],)*
            $($(#[$meaning])* pub $state: &'a mut [$number],)*
            /// Frames that there is room for, a multiple of sixteen.
            pub frames: usize,
            /// Vehicle slots of a simulation.
            pub slots: usize,
        }

        /// Memory of its own for outputs, where nobody has given any.
        pub(crate) struct Storage {
            $($field: Vec<$kind>,)*
            $($state: Vec<$number>,)*
            frames: usize,
            slots: usize,
        }

        impl Storage {
            /// Room for the outputs of a batch.
            pub(crate) fn new(batch: usize, slots: usize, frames: usize) -> Self {
                Self {
                    $($field: vec![0; batch * $size(slots, frames)],)*
                    $($state: vec![0; batch * slots * frames],)*
                    frames,
                    slots,
                }
            }

            /// Outputs into it.
            pub(crate) fn output(&mut self) -> Output<'_> {
                Output {
                    $($field: &mut self.$field,)*
                    $($state: &mut self.$state,)*
                    frames: self.frames,
                    slots: self.slots,
                }
            }
        }

        impl<'a> Output<'a> {
            /// Length that each slice must have for `batch` simulations, by name.
            pub fn sizes(batch: usize, slots: usize, frames: usize) -> Vec<(&'static str, usize)> {
                vec![
                    $((stringify!($field), batch * $size(slots, frames)),)*
                    $((stringify!($state), batch * slots * frames),)*
                ]
            }

            /// One output for each simulation.
            pub(crate) fn into_simulations(self) -> Vec<Output<'a>> {
                let (slots, frames) = (self.slots, self.frames);
                let count = self.num_frames.len();
                $(let mut $field = self.$field.chunks_mut($size(slots, frames).max(1));)*
                $(let mut $state = self.$state.chunks_mut((slots * frames).max(1));)*
                let next = |_| Some(Output {
                    $($field: $field.next()?,)*
                    $($state: $state.next()?,)*
                    slots,
                    frames,
                });
                (0..count).map(next).collect::<Option<Vec<_>>>().unwrap_or_default()
            }
        }
    };
}

with_outputs! { output_fields! {} }
