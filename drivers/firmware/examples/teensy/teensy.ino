/* rtcomp on a Teensy 4.x: quadrature encoder, H-bridge with PWM and direction, an e-stop input.
 *
 *   encoder A, B        pins 0 and 1 (through level shifters where it is a 5 V one: the pins take 3.3 V)
 *   bridge PWM, DIR     pins 4 and 5; ENABLE pin 6, pulled down by a resistor: floating means off
 *   e-stop              pin 7 to ground while all is well, open (pulled up) when pressed or cut
 *
 * Needs the libraries "rtcomp" (this one) and "Encoder". Supply voltage and counts are set below. What the
 * sensor counts, and where forward is, must agree with the motor: test at a low voltage limit first.
 */
#include <Encoder.h>
#include <IntervalTimer.h>
#include <board.h>

static const uint8_t PWM = 4, DIRECTION = 5, ENABLE = 6, STOP = 7;
static const int32_t SUPPLY_UV = 24000000;       /* at full PWM */
static const double COUNT_SIZE = 1e-6;           /* m per count, or rad on a rotary axis */
static const uint32_t WATCH_US = 500;            /* how often the watchdog and the e-stop are looked at */
static const int BITS = 12;

static Encoder encoder(0, 1);
static IntervalTimer timer;
static rt_board board;

/* 64 bits from the 32 of micros(), which wraps after 71 minutes; called far more often than that. */
static uint64_t now_us(void)
{
    static uint32_t before, wraps;
    const uint32_t now = micros();
    wraps += now < before;
    before = now;
    return (uint64_t)wraps << 32 | now;
}

static int read_position(void *, uint64_t, int64_t *counts)
{
    /* 64 bits from the encoder's 32, by differences. */
    static int64_t total;
    static int32_t before;
    const int32_t now = encoder.read();
    total += (int32_t)((uint32_t)now - (uint32_t)before);
    before = now;
    *counts = total;
    return 1;
}

static void write_output(void *, uint64_t, int32_t microvolts)
{
    digitalWriteFast(ENABLE, microvolts != 0);
    digitalWriteFast(DIRECTION, microvolts < 0);
    const int64_t size = microvolts < 0 ? -(int64_t)microvolts : microvolts;
    analogWrite(PWM, (int)(size * ((1 << BITS) - 1) / SUPPLY_UV));
}

static void send(void *, const uint8_t *bytes, size_t size)
{
    if (Serial.availableForWrite() >= (int)size) { /* never wait for a host that does not read */
        Serial.write(bytes, size);
        Serial.send_now();
    }
}

static const rt_facts FACTS = {RT_LINEAR, (uint32_t)SUPPLY_UV, 10000, COUNT_SIZE, "rtcomp on Teensy 4"};
static const rt_hal HAL = {nullptr, read_position, write_output, send};

/* The board's own timer: what it does must not hang on `loop` getting its turn. */
static void watch(void)
{
    const uint64_t now = now_us();
    if (digitalReadFast(STOP)) {
        rt_board_fail(&board, RT_ESTOP, now);
    }
    rt_board_run(&board, now);
}

void setup()
{
    pinMode(ENABLE, OUTPUT);
    digitalWriteFast(ENABLE, LOW);
    pinMode(DIRECTION, OUTPUT);
    pinMode(PWM, OUTPUT);
    pinMode(STOP, INPUT_PULLUP);
    analogWriteResolution(BITS);
    analogWriteFrequency(PWM, 36621);
    Serial.begin(1000000);
    rt_board_init(&board, &FACTS, &HAL);
    timer.begin(watch, WATCH_US);
}

void loop()
{
    uint8_t bytes[256];
    size_t size = 0;
    while (Serial.available() > 0 && size < sizeof bytes) {
        bytes[size++] = (uint8_t)Serial.read();
    }
    if (size > 0) {
        noInterrupts(); /* the board is called from one context at a time */
        rt_board_receive(&board, bytes, size, now_us());
        interrupts();
    }
}
